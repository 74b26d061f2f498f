// SPDX-License-Identifier: Apache-2.0

// The course on the page: its modules with how the trainee stands in them, and of one module the question, the text,
// the expert, practice and the gate. Where the trainee stands follows by the window's own rule, in the program.
import {PlainError} from './core.js';
import {KeptCourse, hold_alone, platform_of, preferred_language} from './lms.js';
import {statement, trainee} from './results.js';
import {element} from './scan.js';
import {fetch_twice} from './source.js';
import {language_in_use, languages, t} from './words.js';

const $ = (id) => document.getElementById(id);

// Everything that the course says, by language; {} stands for what is filled in.
const kCourseWords = {
    en: {
        course: 'Course', cases: 'Cases', leave: 'Back to the learning platform', passed_of: 'Passed {} of {}', due_again: 'due again: {}',
        next: 'Next: {}', module_of: 'Module {} of {}', before: 'Before you read', follows: 'The text follows your answer.',
        right: 'right', chosen: 'your answer', state_due: 'Due again', state_passed: 'Passed', state_locked: 'Locked', state_attempts: 'Attempts: {}',
        state_new: 'Not tried', locked_until: 'Locked until this is passed: {}', needs_case: 'This module needs the case {}, which is not here.',
        practise: 'Practise', exam: 'Start exam', expert: 'Watch the expert', practise_this: 'Practise: {}', at_least: 'at least {}', at_most: 'at most {}',
        last: 'last: {}', gate_both: 'Gate: {} passes in a row, or steady by CUSUM; {}', gate_steady: 'Gate: steady by CUSUM; {}', gate_row: 'Gate: passes in a row: {}; {}',
        as_exam: 'as an exam', as_written: 'as hard as written', in_a_row: 'Passes in a row: {}', in_a_row_of: 'Passes in a row: {} of {}', cusum: 'CUSUM {} / {}', passed_on: 'Passed on {}',
        again_after: 'Asked for again after days: {}', due_since: 'Due since {}', kept: 'Kept: {}', due_on: 'Due on {}', from_pass: 'Counts from the pass',
        back: 'Back to the course', watching: 'You are watching the expert.', watched: 'That was the expert.', end_watching: 'End',
        counted: 'In the course: {}', gate_passed: 'The gate is passed.', not_counted: 'This attempt does not count for the course, which is open in another tab.',
        exam_only: 'Only exams count for this gate.',
        other_tab: 'The course is open in another tab. Go on there; when that tab is closed, this one goes on by itself.',
        damaged: 'What was kept of this course is damaged in part and begins anew there.', keeps_nothing: 'This browser keeps nothing: progress is lost when the page is closed.',
        asking: 'The learning platform is being asked. You can begin: what you do is kept in this browser, and handed over once it answers.',
        no_platform: 'No learning platform answers here. The course works all the same; progress is kept in this browser.',
        session_over: 'The learning platform has closed this session. Go on here: what you do is kept in this browser, and handed over when you open the module from the platform again.',
        bad_launch: 'The learning platform opened this page without all that cmi5 asks for. Progress is kept in this browser. Tell whoever runs the platform.',
        key_expired: 'The key of this launch has been used or is too old. Open the module from the learning platform again; until then what you do is kept in this browser.',
        no_answer: 'The learning platform does not answer. What you do is kept in this browser. The platform is asked again by itself, and when you open the module again.',
        no_launch_data: 'The learning platform has no data for this launch. Progress is kept in this browser. Tell whoever runs the platform.',
        waits: 'Not yet handed over to the learning platform: {}. It is tried again by itself.', refused: 'The learning platform refuses {} records.',
        pass_refused: 'It refuses the pass, which is kept in this browser and told again at the next launch. Tell whoever runs the platform.',
        waits_in_page: 'This browser has no room to keep what waits: leave this page open until all is handed over.',
        not_judged: 'Opened for looking around: nothing is judged.', left: 'All is handed over. You can close this page.', left_waiting: 'Not all could be handed over. It is kept in this browser, and handed over when you open the module again.',
    },
    de: {
        course: 'Kurs', cases: 'Fälle', leave: 'Zurück zur Lernplattform', passed_of: '{} von {} bestanden', due_again: 'wieder fällig: {}',
        next: 'Als Nächstes: {}', module_of: 'Modul {} von {}', before: 'Vor dem Lesen', follows: 'Der Text folgt auf Ihre Antwort.',
        right: 'richtig', chosen: 'Ihre Antwort', state_due: 'Wieder fällig', state_passed: 'Bestanden', state_locked: 'Gesperrt', state_attempts: 'Versuche: {}',
        state_new: 'Nicht versucht', locked_until: 'Gesperrt, bis dies bestanden ist: {}', needs_case: 'Dieses Modul braucht den Fall {}, der nicht hier ist.',
        practise: 'Üben', exam: 'Prüfung starten', expert: 'Experten ansehen', practise_this: 'Üben: {}', at_least: 'mindestens {}', at_most: 'höchstens {}',
        last: 'zuletzt: {}', gate_both: 'Schwelle: {}-mal in Folge bestanden, oder beständig nach CUSUM; {}', gate_steady: 'Schwelle: beständig nach CUSUM; {}', gate_row: 'Schwelle: in Folge bestanden: {}; {}',
        as_exam: 'als Prüfung', as_written: 'so schwer wie vorgesehen', in_a_row: 'In Folge bestanden: {}', in_a_row_of: 'In Folge bestanden: {} von {}', cusum: 'CUSUM {} / {}', passed_on: 'Bestanden am {}',
        again_after: 'Wieder gefragt nach Tagen: {}', due_since: 'Fällig seit {}', kept: 'Behalten: {}', due_on: 'Fällig am {}', from_pass: 'Zählt ab dem Bestehen',
        back: 'Zurück zum Kurs', watching: 'Sie sehen dem Experten zu.', watched: 'Das war der Experte.', end_watching: 'Ende',
        counted: 'Im Kurs: {}', gate_passed: 'Die Schwelle ist bestanden.', not_counted: 'Dieser Versuch zählt nicht für den Kurs, der in einem anderen Tab offen ist.',
        exam_only: 'Für diese Schwelle zählen nur Prüfungen.',
        other_tab: 'Der Kurs ist in einem anderen Tab offen. Machen Sie dort weiter; wird jener Tab geschlossen, geht es hier von selbst weiter.',
        damaged: 'Was von diesem Kurs behalten war, ist teils beschädigt und beginnt dort neu.', keeps_nothing: 'Dieser Browser behält nichts: Der Fortschritt geht verloren, wenn die Seite geschlossen wird.',
        asking: 'Die Lernplattform wird gefragt. Sie können beginnen: Was Sie tun, bleibt in diesem Browser und wird übergeben, sobald sie antwortet.',
        no_platform: 'Hier antwortet keine Lernplattform. Der Kurs geht trotzdem; der Fortschritt bleibt in diesem Browser.',
        session_over: 'Die Lernplattform hat diese Sitzung geschlossen. Machen Sie hier weiter: Was Sie tun, bleibt in diesem Browser und wird übergeben, wenn Sie das Modul auf der Plattform wieder öffnen.',
        bad_launch: 'Die Lernplattform hat diese Seite ohne alles geöffnet, was cmi5 verlangt. Der Fortschritt bleibt in diesem Browser. Sagen Sie es dem Betreiber der Plattform.',
        key_expired: 'Der Schlüssel dieses Aufrufs ist verbraucht oder zu alt. Öffnen Sie das Modul auf der Lernplattform neu; bis dahin bleibt in diesem Browser, was Sie tun.',
        no_answer: 'Die Lernplattform antwortet nicht. Was Sie tun, bleibt in diesem Browser. Die Plattform wird von selbst wieder gefragt, und wenn Sie das Modul wieder öffnen.',
        no_launch_data: 'Die Lernplattform hat keine Daten zu diesem Aufruf. Der Fortschritt bleibt in diesem Browser. Sagen Sie es dem Betreiber der Plattform.',
        waits: 'Noch nicht an die Lernplattform übergeben: {}. Es wird von selbst wieder versucht.', refused: 'Die Lernplattform lehnt {} Einträge ab.',
        pass_refused: 'Sie lehnt das Bestehen ab. Es bleibt in diesem Browser und wird beim nächsten Öffnen noch einmal gemeldet. Sagen Sie es dem Betreiber der Plattform.',
        waits_in_page: 'Dieser Browser hat keinen Platz für das, was wartet: Lassen Sie diese Seite offen, bis alles übergeben ist.',
        not_judged: 'Zum Umsehen geöffnet: Nichts wird gewertet.', left: 'Alles ist übergeben. Sie können diese Seite schließen.', left_waiting: 'Nicht alles konnte übergeben werden. Es bleibt in diesem Browser und wird übergeben, wenn Sie das Modul wieder öffnen.',
    },
};
function course_language() { return document.documentElement.lang.startsWith('de') ? 'de' : 'en'; }
function course_words(key, ...what) {
    return kCourseWords[course_language()][key].replaceAll('{}', () => String(what.shift() ?? ''));
}
// As plain_identifier() of the packages has it, which goes by the bytes of UTF-8.
const plain_identifier = (name) => [...new TextEncoder().encode(name)].map((byte) => String.fromCharCode(byte).replace(/[^0-9A-Za-z]/, '-')).join('') || '-';
// The trainee's own day and time in the form of UTC, which the program's rule reads.
const local_iso = (ms) => new Date(ms - 60000 * new Date(ms).getTimezoneOffset()).toISOString();
// The language that the address or the learner asked for on this page; null: neither.
function chosen_language() {
    try {
        return new URLSearchParams(location.search).get('lang') ?? localStorage.getItem('sonocase-language');
    } catch {
        return null;  // forbidden, as in some frames
    }
}

export class CourseView {
    // app: for what leads away from the course
    constructor(app) {
        this.app = app;
        this.alone = false;
        $('course-back').addEventListener('click', () => this.leave());
        $('end-watching').addEventListener('click', () => this.end_watching());
        addEventListener('pagehide', () => this.kept?.platform.leave());
    }
    get platform() { return this.kept?.platform; }
    // A package's page is about one module, and the platform leads to the others.
    single() { return Boolean(this.list.package && this.asked); }

    // list: cases.json.
    async begin(list) {
        this.list = list;
        const response = await fetch_twice(list.course, {}, (r) => r.ok);
        this.toml = await response.text();
        this.core = await this.app.program();
        this.read();
        const asked = new URLSearchParams(location.search).get('module');
        const all = this.course.modules.map((module) => module.name);
        const wanted = all.filter((name) => plain_identifier(name) === asked);
        if (asked && !wanted.length) throw new PlainError(`This course has no module named ${asked}.`);
        this.asked = asked;
        this.names = list.package && asked ? wanted : all;
        // A platform opens one module; without a module nobody opened this.
        const platform = platform_of(this.single() ? list.package : '', list.xapi ?? '');
        if (list.package && !this.single()) platform.words = 'no_platform';
        this.kept = new KeptCourse(this.course.name, this.names, trainee(), platform);
        this.kept.read();
        this.kept.changed = () => this.go_on();
        platform.on_words = () => this.say();
        platform.on_language = (list) => this.show_in(list);
        this.shown = wanted[0] ?? null;
        await new Promise((settled) => hold_alone(this.kept.lock_name(), () => {
            this.take_over().catch((error) => this.app.say(error));
            settled();
        }, () => {
            this.alone = false;
            this.refresh();
            settled();
        }));
        this.show_card();
        if (asked || list.package) this.show();
    }
    // Once no other tab has the course. A platform may take long to answer: the course is shown meanwhile.
    async take_over() {
        const asked = this.kept.begin();
        this.alone = true;
        this.refresh();
        await asked;
        this.go_on();
    }
    // The platform has answered, or not; whoever is at a button meanwhile stays there.
    go_on() {
        const focused = document.activeElement?.closest('#course button')?.textContent;
        this.tell();
        this.refresh();
        if (focused) [...document.querySelectorAll('#course button')].find((one) => one.textContent === focused)?.focus({preventScroll: true});
    }
    // list: the languages that the learner prefers on the platform. True: the page is loaded again in one of them.
    show_in(list) {
        const code = preferred_language(list, languages().map(([one]) => one));
        // Only before the learner has begun, and where the page keeps the key of its launch.
        if (this.switched || !code || code === language_in_use() || chosen_language() || this.app.scan.shown() || !this.platform.keep_session()) return false;
        this.switched = true;
        const address = new URL(location.href);
        address.searchParams.set('lang', code);
        location.replace(address);
        return true;
    }
    // Again in another language.
    read() {
        this.course = this.core.open_course(this.toml, course_language());
        this.metrics = new Map(this.core.metric_words().map((one) => [one.name, one]));
    }
    language_changed() {
        if (!this.toml) return;
        this.read();
        this.refresh();
    }
    trainee_changed() {
        if (!this.kept || this.platform.learner) return;
        this.kept.trainee_name = trainee();
        this.kept.read();
        this.refresh();
    }

    standing() {
        const attempts = new Map(), answers = [];
        for (const module of this.course.modules) {
            if (!this.names.includes(module.name)) continue;
            const state = this.kept.state(module.name);
            if (state.option >= 0 && state.option < module.options.length) answers.push({module: module.name, option: state.option});
            state.attempts.forEach((one, n) => {
                const key = `${one.started_ms} ${module.case} ${module.exercise}`;
                const entry = attempts.get(key) ?? {case: module.case, exercise: module.exercise, passed: one.passed, exam: one.exam, values: {},
                    started_ms: one.started_ms, started: local_iso(one.started_ms)};
                if (n === state.attempts.length - 1 && module.measure && state.value !== null) entry.values[module.measure] = state.value;
                attempts.set(key, entry);
            });
        }
        const now = this.core.stand_in_course({today: local_iso(Date.now()), attempts: [...attempts.values()].sort((a, b) => a.started_ms - b.started_ms).map(({started_ms, ...one}) => one), answers});
        this.course.modules.forEach((module, n) => {
            const one = now.modules[n];
            if (this.single()) one.open = true;  // the platform leads through the course
            const told = this.names.includes(module.name) && this.kept.state(module.name).told;
            if (told && !one.passed) Object.assign(one, {passed: true, passed_on: told, part: 1});  // its attempts were too many to keep
        });
        return now;
    }
    // What is kept, to this browser and to the platform.
    tell(only = this.names) {
        if (!this.alone) return;
        const now = this.standing(), today = new Date().toISOString().slice(0, 10);
        this.course.modules.forEach((module, n) => {
            if (only.includes(module.name)) this.kept.save(module.name, now.modules[n].part, now.modules[n].passed, today);
        });
    }

    show_card() {
        const now = this.standing(), next = this.course.modules[now.next];
        const words = [next ? course_words('next', next.title) : '', course_words('passed_of', now.passed, this.course.modules.length),
            now.due ? course_words('due_again', now.due) : ''].filter((one) => one).join(' · ');
        const open = element('button', course_words('course'), {type: 'button', id: 'open-course', className: 'prime'});
        open.addEventListener('click', () => this.show());
        const text = element('div');
        text.append(element('strong', this.course.title), element('p', words, {className: 'second'}));
        $('course-card').replaceChildren(text, open);
        $('course-card').hidden = false;
    }
    show() {
        this.app.show('course');
        this.refresh();
        $('course-title').focus({preventScroll: true});
    }
    refresh() {
        if (!this.kept) return;
        this.left = false;
        const now = this.now = this.standing();
        const {modules} = this.course;
        if (!this.shown) this.shown = modules[now.next < 0 ? modules.length - 1 : now.next].name;
        $('course-title').textContent = this.course.title;
        $('course-words').textContent = this.course.text;
        $('course-back').textContent = course_words(this.list.package && !['no_platform'].includes(this.platform.words) ? 'leave' : 'cases');
        $('modules').hidden = this.single();
        if (this.single()) for (const id of ['to-cases', 'after-cases']) $(id).textContent = course_words('course');
        $('modules').replaceChildren(...modules.map((module, n) => this.module_row(module, now.modules[n])));
        this.say();
        const n = modules.findIndex((module) => module.name === this.shown);
        this.show_module(modules[n], now.modules[n], n);
        if (!$('course-card').hidden) this.show_card();
    }
    say() {
        const {platform} = this, waiting = platform.waiting();
        $('course-notice').textContent = [this.left ? course_words(waiting || platform.words ? 'left_waiting' : 'left') : '', this.alone ? '' : course_words('other_tab'),
            platform.words ? course_words(platform.words) : '',
            platform.last_status === 401 || platform.last_status === 403 ? course_words('key_expired') : waiting ? course_words('waits', waiting) : '',
            platform.waits_in_page?.() ? course_words('waits_in_page') : '', platform.refused ? course_words('refused', platform.refused) : '',
            platform.pass_refused ? course_words('pass_refused') : '', platform.judged === false ? course_words('not_judged') : '',
            this.kept.damaged ? course_words('damaged') : '', this.kept.keeps ? '' : course_words('keeps_nothing')].filter((one) => one).join(' ');
    }
    state_words(now) {
        if (now.due) return [course_words('state_due'), 'warning'];
        if (now.passed) return [`✓ ${course_words('state_passed')}`, 'pass'];
        if (!now.open) return [course_words('state_locked'), 'second'];
        return [now.attempts ? course_words('state_attempts', now.attempts) : course_words('state_new'), 'second'];
    }
    module_row(module, now) {
        const button = element('button', '', {type: 'button'});
        const [words, looks] = this.state_words(now);
        button.append(element('span', module.title), element('span', words, {className: looks}));
        if (module.name === this.shown) button.setAttribute('aria-current', 'true');
        button.addEventListener('click', () => { this.shown = module.name; this.refresh(); });
        const item = element('li');
        item.append(button);
        return item;
    }
    // By the case's name, as in recordings; by its title where a course was published that names that.
    entry_of(module) {
        const {cases} = this.list, has = (one) => one.exercises?.some((exercise) => exercise.name === module.exercise);
        const named = cases.filter((one) => (one.case ?? one.title) === module.case), titled = cases.filter((one) => one.title === module.case);
        const found = named.length ? named : titled;
        return found.find(has) ?? found[0];
    }
    // Attempts and the open case have the name.
    case_of(module) {
        const entry = this.entry_of(module);
        return entry?.case ?? entry?.title ?? module.case;
    }
    measure_title(name) { return t(this.metrics.get(name)?.title ?? name); }
    value_words(module, value) {
        if (value === null || !Number.isFinite(value)) return '–';
        if (module.measure.endsWith('_fraction')) return `${Math.round(100 * value)} %`;
        return `${Number(value.toFixed(1))} ${this.metrics.get(module.measure)?.unit ?? ''}`.trim();
    }
    gate_words({gate}) {
        const how = course_words(gate.exam ? 'as_exam' : 'as_written');
        if (gate.passes_in_a_row > 0 && gate.steady) return course_words('gate_both', gate.passes_in_a_row, how);
        return gate.steady ? course_words('gate_steady', how) : course_words('gate_row', gate.passes_in_a_row, how);
    }
    stands_words(module, now) {
        if (now.passed) return course_words('passed_on', now.passed_on);
        const row = module.gate.passes_in_a_row;
        return [row > 0 ? course_words('in_a_row_of', now.in_a_row, row) : course_words('in_a_row', now.in_a_row), module.gate.steady ? course_words('cusum', now.cusum.toFixed(1), now.cusum_needed.toFixed(0)) : '']
            .filter((one) => one).join(' · ');
    }

    show_module(module, now, n) {
        const paragraphs = (text) => text.split('\n').map((one) => element('p', one));
        const fact = (words, below, looks = '') => {
            const line = element('p', words, {className: `fact ${looks}`.trim()});
            line.append(element('span', below, {className: 'second'}));
            return line;
        };
        const parts = [element('p', course_words('module_of', n + 1, this.course.modules.length), {className: 'second'}),
            element('h2', module.title, {id: 'module-title'})];
        const asks = module.options.length > 0, answered = now.option >= 0;
        if (asks) parts.push(...this.question(module, now.option));
        if (!asks || answered) parts.push(...paragraphs(module.text));
        else parts.push(element('p', course_words('follows'), {className: 'second'}));
        if (module.measure) {
            const limits = [module.at_least === null ? '' : course_words('at_least', this.value_words(module, module.at_least)),
                module.at_most === null ? '' : course_words('at_most', this.value_words(module, module.at_most))].filter((one) => one).join(', ');
            parts.push(fact(course_words('practise_this', this.measure_title(module.measure)),
                `${limits} · ${course_words('last', this.value_words(module, now.measured))}`, now.in_limits ? 'pass' : ''));
        }
        parts.push(fact(this.gate_words(module), this.stands_words(module, now), now.passed ? 'pass' : ''));
        if (module.retention_days && !this.single()) {
            const when = now.due ? course_words('due_since', now.due_on) : now.kept_on ? course_words('kept', now.kept_on)
                : now.passed ? course_words('due_on', now.due_on) : course_words('from_pass');
            parts.push(fact(course_words('again_after', module.retention_days), when, now.due ? 'warning' : ''));
        }
        const entry = this.entry_of(module), before = this.course.modules[Math.max(this.now.next, 0)];
        if (!now.open) parts.push(element('p', course_words('locked_until', before.title), {className: 'warning'}));
        if (!entry) parts.push(element('p', course_words('needs_case', module.case), {className: 'warning'}));
        const row = element('div', '', {className: 'row'});
        const button = (id, key, looks, may, what) => {
            const one = element('button', course_words(key), {type: 'button', id, className: looks, disabled: !may});
            one.addEventListener('click', what);
            row.append(one);
        };
        button('module-begin', module.gate.exam ? 'exam' : 'practise', 'prime', entry && now.open, () => this.practise(module));
        if (module.expert) button('module-expert', 'expert', '', entry, () => this.watch(module));
        $('module').replaceChildren(...parts, row);
    }
    question(module, option) {
        const parts = [element('p', course_words('before'), {className: 'second'}), element('p', module.question, {className: 'asked'})];
        const stack = element('div', '', {className: 'stack'});
        module.options.forEach((words, n) => {
            if (option < 0) {
                const one = element('button', words, {type: 'button', disabled: !this.alone});
                one.addEventListener('click', () => this.answer(module, n));
                stack.append(one);
                return;
            }
            const marks = [n === module.answer ? `✓ ${course_words('right')}` : '', n === option ? course_words('chosen') : ''].filter((one) => one).join(', ');
            const line = element('p', words, {className: n === module.answer ? 'pass' : n === option ? 'fail' : 'second'});
            if (marks) line.append(element('span', ` (${marks})`));
            stack.append(line);
        });
        parts.push(stack);
        if (option >= 0 && module.because) parts.push(element('p', module.because));
        return parts;
    }
    step_to(module, phase) {
        if (!this.alone) return;
        this.kept.state(module.name).phase = phase;
        this.tell([module.name]);
    }
    answer(module, option) {
        if (!this.alone || this.kept.state(module.name).option >= 0) return;
        this.kept.state(module.name).option = option;
        this.step_to(module, 'text');
        this.refresh();
        $('module').querySelector('#module-begin')?.focus();
    }

    async go_to(module) {
        const {app} = this, index = app.description?.exercises.findIndex((one) => one.name === module.exercise) ?? -1;
        if (app.core && app.description?.case_name === this.case_of(module) && index >= 0) await app.choose_exercise(index);
        else await app.open(this.entry_of(module), module.exercise);
        return app.scan.shown();
    }
    async practise(module) {
        this.step_to(module, 'practice');
        if (!await this.go_to(module)) return;
        $('mode').value = module.gate.exam ? 'exam' : 'practice';
        this.app.scan.touched();
    }
    async watch(module) {
        this.step_to(module, 'expert');
        if (!await this.go_to(module)) return;
        this.app.core.watch(module.expert, performance.now() / 1000);
        this.watched = module;
        $('end-watching').textContent = course_words('end_watching');
        $('end-watching').hidden = false;
        this.app.scan.notice(course_words('watching'));
    }
    // After each picture.
    frame_shown() {
        if (!this.watched || this.app.core.calls.watching()) return;
        const attempt = this.app.scan.values.attempt === 1;
        this.app.scan.notice(attempt ? '' : course_words('watched'));
        this.watched = null;
        if (attempt) $('end-watching').hidden = true;
    }
    end_watching() {
        this.watched = null;
        $('end-watching').hidden = true;
        this.app.core.calls.end_watching();
        this.show();
    }
    scan_left() {
        this.watched = null;
        $('end-watching').hidden = true;
    }

    // attempt: as app.js keeps it; score: of the program.
    attempt_done(attempt, score) {
        $('after-course').hidden = true;
        if (!this.kept) return;
        const here = this.course.modules.filter((module) => this.names.includes(module.name) && this.case_of(module) === attempt.case_name && module.exercise === attempt.exercise);
        if (!here.length) return;
        let words = course_words('not_counted');
        if (this.alone) {
            for (const module of here) {
                const state = this.kept.state(module.name);
                state.attempts.push({started_ms: attempt.started_ms, passed: attempt.passed, exam: attempt.exam});
                state.value = score.metrics[module.measure] ?? null;
                state.phase = 'practice';
            }
            this.tell(here.map((module) => module.name));
            const now = this.standing(), module = here.find((one) => one.name === this.shown) ?? here[0];
            const stands = now.modules[this.course.modules.indexOf(module)];
            words = course_words('counted', stands.passed ? course_words('gate_passed')
                : module.gate.exam && !attempt.exam ? course_words('exam_only') : this.stands_words(module, stands));
        }
        const back = element('button', course_words('back'), {type: 'button', id: 'after-to-course', className: 'prime'});
        back.addEventListener('click', () => this.show());
        $('after-course').replaceChildren(element('p', words), back);
        $('after-course').hidden = false;
    }
    // Statements of attempts: cmi5 takes them into its session. False: they go their usual way.
    takes(which) {
        if (this.list?.package !== 'cmi5' || !this.platform) return false;
        if (this.alone) this.platform.attempted(which.filter(([verb]) => verb !== 'completed').map((one) => statement(...one)), which.some(([verb]) => verb === 'scored'));
        return true;
    }
    remove() {
        if (!this.kept || !this.alone) return;
        this.kept.remove();
        this.refresh();
    }

    async leave() {
        if (!this.list.package || this.platform.words === 'no_platform') {
            this.app.show('start');
            return;
        }
        const address = this.alone ? await this.platform.end() : '';
        if (address) {
            location.assign(address);
            return;
        }
        close();  // works where a script opened the page
        this.left = true;
        this.say();
    }
}
