// SPDX-License-Identifier: Apache-2.0

// The pages and the ways between them: cases, scanning, after an attempt, scores.
import {Core, PlainError, has_simd} from './core.js';
import {download, file_name, keep_attempt, kept_attempts, launch_of, minutes, recording_of, remove_attempt, remove_attempts, send_statements, set_trainee, statement, store_waits, trainee, when_store_opens, words_of_sending} from './results.js';
import {PoseSource} from './poses.js';
import {ScanPage, element} from './scan.js';
import {key_words} from './scan_keys.js';
import {ArrivingCase} from './arriving.js';
import {forget_other_cases, inside_page, is_case, load_list, open_bytes} from './source.js';
import {begin_words, choose_language, exercise_texts, language_in_use, languages, missing_words, t} from './words.js';

const $ = (id) => document.getElementById(id);
const kBeforeS = 2;  // a moment is shown from this long before it, as in the window
const kShortestAttemptS = 5;
const kStartBytes = 65536;
const kPages = ['start', 'course', 'scan', 'after', 'scores'];

class App {
    constructor() {
        this.scan = new ScanPage(this);
        this.listen();
    }

    listen() {
        const click = (id, what) => $(id).addEventListener('click', what);
        for (const button of document.querySelectorAll('.open-help')) button.addEventListener('click', () => this.help());
        $('language').replaceChildren(...languages().map(([code, name]) => new Option(name, code)));
        $('language').value = language_in_use();
        $('language').addEventListener('change', () => choose_language($('language').value));
        click('guided', () => this.go_on('guide'));
        click('practise', () => this.go_on('practice'));
        click('examine', () => this.go_on('exam'));
        click('next', () => this.choose_exercise(this.exercise + 1));
        $('search').addEventListener('input', () => this.list_cases());
        click('open-about', () => $('about').showModal());
        for (const button of document.querySelectorAll('dialog .close')) button.addEventListener('click', () => button.closest('dialog').close());
        click('open-scores', () => this.show_scores());
        click('scores-back', () => this.show('start'));
        click('scores-remove', () => this.remove_scores());
        click('to-cases', () => this.to_cases());
        click('after-cases', () => this.show_first());
        click('again', () => this.try_again());
        click('replay', () => this.show_moment(0, true));
        click('to-results', () => this.show('after'));
        click('save-recording', () => this.save(this.attempt, 'recording'));
        click('save-scores', () => this.save(this.attempt, 'scores'));
        click('loading-stop', () => this.loading?.abort());
        click('browse', () => $('file').click());
        $('file').addEventListener('change', () => this.open_file($('file').files[0]));
        // Reloading the page or closing it would lose the attempt without a word.
        addEventListener('beforeunload', (e) => {
            if (!this.attempt_runs()) return;
            e.preventDefault();
            e.returnValue = true;  // browsers of before 2024
        });
        when_store_opens(() => {
            if ($('notice').textContent === waiting_words()) $('notice').textContent = '';
            if (!$('start').hidden && this.list) this.show_cases();
            else if (!$('scores').hidden) this.show_scores();
        });
        $('trainee').value = trainee();
        $('trainee').addEventListener('change', () => { set_trainee($('trainee').value.trim()); this.course?.trainee_changed(); });
        addEventListener('dragover', (e) => { e.preventDefault(); $('drop').classList.add('over'); });
        addEventListener('dragleave', () => $('drop').classList.remove('over'));
        addEventListener('drop', (e) => {
            e.preventDefault();
            $('drop').classList.remove('over');
            if (e.dataTransfer.files.length) this.open_file(e.dataTransfer.files[0]);
        });
    }

    async start() {
        $('drop').hidden = false;
        show_own_keys();
        const asked = new URLSearchParams(location.search);
        if (asked.get('poses')) this.scan.poses = new PoseSource(asked.get('poses'), (words) => this.scan.tracker_says(words));
        const program = this.program();
        program.catch(() => {});  // said below
        try {
            this.list = await load_list();
            forget_other_cases(this.list.cases);
            this.send_waiting();
            addEventListener('online', () => this.send_waiting());
        } catch (error) {
            this.list = {cases: []};
            this.say(error);
        }
        const ready = program.then(async (core) => {
            this.counts = core;
            if (!$('start').hidden) await this.show_cases();
            this.ready = true;
        }).catch((error) => this.say(error));
        const wanted = this.list.cases.find((one) => one.name === asked.get('case'));
        if (!wanted) this.show_cases();
        if (asked.get('case') && !wanted) this.say(new PlainError(t('This site has no case named {}.', asked.get('case'))));
        if (wanted) await this.open(wanted, asked.get('exercise'));
        const course = this.open_course().catch((error) => this.say(error));
        if (wanted) this.show_cases();  // its pictures need not come before that of the case
        await ready;
        await course;
    }

    // Its part of the page is fetched where a site has a course.
    async open_course() {
        if (!this.list.course) return;
        const {CourseView} = await import('./course.js');
        this.course = new CourseView(this);
        await this.course.begin(this.list);
    }

    // The program, compiled while it arrives; once for all cases.
    program() {
        this.program_made ??= (async () => {
            if (!globalThis.WebAssembly)
                throw new PlainError(t('This browser has no WebAssembly, which the pictures need. Use a current browser.'));
            const inside = inside_page('program');
            try {
                const module = inside ? await WebAssembly.compile(inside) : await compile_from(program_file());
                const core = await Core.create(module);
                performance.mark('program-here');
                return core;
            } catch (error) {
                if (error instanceof PlainError) throw error;
                if (error instanceof RangeError || /memory/i.test(error?.message ?? ''))
                    throw new PlainError(t('There is not enough memory for the program. Close other pages and load this page again.'));
                throw new PlainError(t('The program did not load. Check the network and load the page again.'));
            }
        })();
        return this.program_made;
    }

    show(name) {
        for (const page of kPages) $(page).hidden = page !== name;
        document.body.classList.toggle('scanning', name === 'scan');
        if (name !== 'scan') {
            this.scan.hide();
            this.course?.scan_left();
        }
        if (name === 'start' && this.list) this.show_cases();
        scrollTo(0, 0);
    }
    // A learning platform's trainee came for a module, not for the cases.
    show_first() {
        if (this.course?.single()) this.course.show();
        else this.show('start');
    }
    // On the page that is shown.
    say(error) {
        console.error(error);
        const shown = kPages.find((page) => !$(page).hidden);
        $({scan: 'bar-notice', after: 'after-notice', scores: 'scores-words', course: 'course-notice'}[shown] ?? 'notice').textContent = error instanceof PlainError ? error.message
            : error instanceof WebAssembly.RuntimeError || error instanceof RangeError
                ? t('There is not enough memory for this case. Close other pages and load this page again.')
                : t('Something failed that should not: {}', error.message);
    }

    // Each case with the ultrasound at its start, and its exercises with how the trainee stands.
    async show_cases() {
        if (this.list.cases.length) await this.read_kept();
        this.list_cases();
        if (store_waits() && !$('notice').textContent) $('notice').textContent = waiting_words();
    }
    // Those that the search finds, with what has been read.
    list_cases() {
        const wanted = $('search').value.trim().toLowerCase();
        const shown = this.list.cases.filter((entry) => [entry.title, entry.name, ...entry.exercises.map(title_of)].some((one) => one.toLowerCase().includes(wanted)));
        const stands = this.standings(), focused = [...$('cases').querySelectorAll('button')].indexOf(document.activeElement);
        $('search').hidden = this.list.cases.length < 2;
        $('cases').replaceChildren(...shown.map((entry) => {
            const item = element('li');
            const picture = entry.preview ? element('img', '', {src: entry.preview, alt: '', loading: 'lazy'})
                : element('span', '', {className: 'no-picture'});
            picture.addEventListener('click', () => this.open(entry));  // as the first exercise, for who points at it
            const words = element('div', '', {className: 'words'});
            words.append(element('h2', entry.title), element('p', t('%s · %.1f MB · exercises: %zu', entry.name, entry.bytes / 1e6, entry.exercises.length), {className: 'second'}));
            item.append(picture, words, ...entry.exercises.map((exercise) => {
                const button = element('button', '', {type: 'button'}), {good, said} = this.standing_words(stands.get(exercise));
                button.append(element('span', good === null ? '◎' : good ? '✓' : '✗', {className: `mark ${good === null ? '' : good ? 'pass' : 'fail'}`}),
                    element('span', title_of(exercise)), element('span', said, {className: 'second'}));
                button.firstChild.setAttribute('aria-hidden', 'true');
                button.addEventListener('click', () => this.open(entry, exercise.name));
                return button;
            }));
            return item;
        }));
        $('cases').querySelectorAll('button')[focused]?.focus();
        this.show_next();
        if (!this.list.cases.length) $('notice').textContent = t('This site holds no case. Open one from a file.');
    }
    async read_kept() {
        try {
            this.kept = await kept_attempts() ?? [];
        } catch {
            this.kept = [];
        }
    }
    // Of whoever is named on the page of scores: several may share a browser.
    own_attempts() {
        const name = $('trainee').value.trim();
        return (this.kept ?? []).filter((one) => !one.damaged && one.trainee === name);
    }
    attempts_of(case_name, exercise) {
        return this.own_attempts().filter((one) => one.case_name === case_name && one.exercise === exercise);
    }
    // How the trainee stands with each exercise of the site, by the window's rule, which the program has.
    standings() {
        const asked = this.list.cases.flatMap((entry) => entry.exercises.map((exercise) => ({entry, exercise})));
        if (!this.counts) return new Map();
        const attempts = this.own_attempts().map(({case_name, exercise, started, passed, seed, metrics}) => {
            const mm = metrics.final_tip_to_target_mm;
            return {case: case_name, exercise, started, passed: passed === true, seed: Number.isFinite(seed) ? seed : 0, values: Number.isFinite(mm) ? {final_tip_to_target_mm: mm} : {}};
        });
        const standings = this.counts.stand_with({attempts, asked: asked.map(({entry, exercise}) => (
            {case: entry.case ?? entry.title, exercise: exercise.name, mastery: exercise.mastery}))});
        return new Map(asked.map(({exercise}, n) => [exercise, standings[n]]));
    }
    // Undefined: the program, which knows, is still on its way.
    standing_words(standing) {
        if (!standing) return {good: null, said: ''};
        const {attempts, passes, mastered, best_mm} = standing;
        if (!attempts) return {good: null, said: t('Not tried')};
        const said = mastered ? t('Mastered') : passes ? t('Passed %d of %d', passes, attempts) : t('Not passed in %d', attempts);
        return {good: passes > 0, said: best_mm === null ? said : `${said} · ${t('best')} ${best_mm.toFixed(1)} mm`};
    }
    // Where a trainee goes on: the exercise tried last, the one after it once that was passed; at first the first.
    next_exercise() {
        const all = this.list.cases.flatMap((entry) => entry.exercises.map((exercise) => ({entry, exercise})));
        const last = this.own_attempts().at(-1);
        const at = last ? all.findIndex(({entry, exercise}) => (entry.case ?? entry.title) === last.case_name && exercise.name === last.exercise) : -1;
        return all[Math.min(at + (last?.passed ? 1 : 0), all.length - 1)] ?? all[0];
    }
    show_next() {
        const next = this.next_exercise();
        $('go-on').hidden = !next;
        if (next) $('next-title').textContent = `${title_of(next.exercise)} · ${next.entry.title}`;
    }
    async go_on(how) {
        const {entry, exercise} = this.next_exercise();
        await this.open(entry, exercise.name);
        if (!this.scan.shown()) return;
        if (how === 'guide') this.scan.run_guide(true);
        else {
            $('mode').value = how;
            await this.start_attempt();
        }
    }

    async open(entry, exercise = null) {
        await this.load(entry.title, (program, progress, signal) => this.open_entry(program, entry, progress, signal), exercise);
    }
    // Opens a case of the site as soon as what a picture needs first is there; the rest follows behind.
    async open_entry(program, entry, progress, signal) {
        const inside = inside_page(`case-${entry.name}`);
        if (inside) return open_bytes(await program, inside, entry.title);
        const arriving = new ArrivingCase(program, entry, () => this.scan.touched());
        signal.addEventListener('abort', () => arriving.stop());
        await arriving.begin(progress);
        performance.mark('case-arrived');
        const description = arriving.core.open(entry.title);
        this.arriving_case = arriving;
        return description;
    }
    // The case's last parts are still on their way.
    arriving() { return Boolean(this.arriving_case?.busy); }
    arriving_words() {
        const arriving = this.arriving_case, {missing, segments_left} = this.scan.values;
        if (!arriving || !segments_left) return '';
        if (arriving.trouble) return arriving.trouble;
        const part = Math.floor(100 * arriving.part);
        return missing ? t('Loading this part of the case: less structure until then (%d %%)', part) : t('Loading the case: %d %%', part);
    }
    // False: the trainee would rather go on, or the case cannot be loaded.
    async whole_case(words) {
        if (!this.scan.values.segments_left) return true;
        $('wait-words').textContent = words;
        $('wait').showModal();
        this.scan.held = true;
        const back = new Promise((done) => { $('wait-back').onclick = $('wait').oncancel = () => done(false); });
        const failed = (error) => { this.scan.notice(error.message); return false; };
        const whole = await Promise.race([back, this.arriving_case.whole.then(() => true, failed)]);
        this.scan.held = false;
        $('wait').close();
        return whole;
    }
    async open_file(file) {
        if (!file) return;
        try {
            // What is no case need not be read wholly, and leaves the attempt alone: its first bytes tell the program enough.
            const start = await bytes_of(file.slice(0, kStartBytes), file.name), whole = is_case(start);
            const left = whole ? await this.may_leave() : {scored: ''};
            if (!left) return;
            const bytes = whole ? await bytes_of(file, file.name) : start;
            await this.load(file.name, async (program) => open_bytes(await program, bytes, file.name), null, true);
            if (left.scored) $(this.scan.shown() ? 'bar-notice' : 'after-notice').textContent += ` ${left.scored}`;
        } catch (error) {
            this.say(error);
        } finally {
            $('file').value = '';
        }
    }
    // how(program, progress, signal) gives the description of the opened case. at_once: it opens the case in one piece, so that
    // the one that is open stays until then, and where that fails.
    async load(title, how, exercise, at_once = false) {
        const before = {loading: this.loading, arriving_case: this.arriving_case}, loading = new AbortController();
        const leave_last = () => {
            before.loading?.abort();
            if (this.arriving_case === before.arriving_case) this.arriving_case = null;
        };
        const stays = at_once && before.arriving_case;
        if (!stays) {
            leave_last();
            this.loading = loading;
        }
        $('notice').textContent = '';
        $('loading').hidden = false;
        const progress = (part) => {
            $('loading-words').textContent = t('Loading %s: %d %%', title, Math.floor(100 * part));
            $('loading-bar').value = part;
        };
        progress(0);
        try {
            const program = this.program();
            const description = await how(program, progress, loading.signal);
            if (stays) {
                leave_last();
                this.loading = loading;
            }
            this.core = await program;
            if (loading.signal.aborted) return;
            performance.mark('case-open');
            this.description = description;
            const index = description.exercises.findIndex((one) => one.name === exercise);
            if (exercise && index < 0) this.scan.notice(t('This case has no exercise named {}.', exercise));
            else this.scan.notice(description.warnings.join(' '));
            await this.choose_exercise(Math.max(index, 0));
        } catch (error) {
            if (error.name !== 'AbortError') this.say(error);
        } finally {
            if (this.loading === loading || stays) $('loading').hidden = true;
        }
    }

    async choose_exercise(index) {
        const left = this.attempt_runs() ? await this.may_leave() : {scored: ''};
        if (!left) {
            $('exercise').value = this.exercise;
            return;
        }
        const count = this.description.exercises.length;
        this.exercise = (index % count + count) % count;
        this.show('scan');
        try {
            const {width, height} = this.scan.size();
            this.core.choose_exercise(this.exercise, width, height);
            performance.mark('exercise-chosen');
        } catch (error) {
            this.show('start');
            this.say(error);
            return;
        }
        this.scan.show(this.core, this.description, this.exercise);
        if (left.scored) this.scan.notice(left.scored);
        $('picture').focus({preventScroll: true});
    }
    // As the attempt before: an exam is tried again as an exam.
    async try_again() {
        const mode = this.attempt.exam ? 'exam' : 'practice';
        await this.choose_exercise(this.exercise);
        $('mode').value = mode;
        this.scan.touched();
    }
    async to_cases() {
        const left = await this.may_leave();
        if (!left || left.scored) return;  // an exam that was left shows its result
        this.core.calls.drop_attempt();
        this.show_first();
    }
    attempt_runs() { return this.scan.shown() && this.scan.values.attempt === 1; }
    // Before anything that ends the attempt. False: the trainee stays; {scored}: what became of an exam, which ends as it is
    // and counts, as in the window; '': nothing ran, or it was a practice, which is not kept.
    async may_leave() {
        if (!this.attempt_runs()) return {scored: ''};
        const counts = this.scan.exam() && this.scan.values.seconds >= kShortestAttemptS;
        const words = counts ? t('Leave the exam? It ends as it is, and it counts.') : t('Leave this attempt? It will not be kept.');
        if (!await this.ask(words, t('Stay'), t('Leave'))) return false;
        if (!this.attempt_runs()) return {scored: ''};
        if (!counts) {
            this.core.calls.drop_attempt();
            this.scan.values = this.core.values();
            return {scored: ''};
        }
        if (!await this.score_attempt()) return false;
        return {scored: [this.attempt.passed ? t('The exam was scored: passed.') : t('The exam was scored: not passed yet.'), $('after-notice').textContent].filter((one) => one).join(' ')};
    }
    help() { if (!$('help').open) $('help').showModal(); }
    download(...what) { download(...what); }

    // True for yes. One question at a time.
    async ask(words, no, yes) {
        if ($('ask').open) return false;
        $('ask-words').textContent = words;
        $('ask-no').textContent = no;
        $('ask-yes').textContent = yes;
        $('ask').showModal();
        return new Promise((done) => {
            const answer = (is_yes) => () => { $('ask').close(); done(is_yes); };
            $('ask-no').onclick = answer(false);
            $('ask-yes').onclick = answer(true);
            $('ask').oncancel = () => done(false);
        });
    }

    // Recordings have the second of their begin; two attempts of one second, in two tabs, differ by the millisecond.
    began(ms) {
        this.started_ms = ms;
        this.started = new Date(ms).toISOString().replace(/\.\d+Z$/, 'Z');
    }
    // The targets lie elsewhere in each attempt, drawn from a seed that the recording keeps.
    async start_attempt() {
        const {drawn} = this.description.exercises[this.exercise];
        if (drawn && !await this.whole_case(t('A new place of the target needs the whole case, which is still loading.'))) return;
        const asked = Number(new URLSearchParams(location.search).get('seed'));
        const seed = !drawn ? 0 : asked > 0 ? asked : 1 + crypto.getRandomValues(new Uint32Array(1))[0] % 1e9;
        this.began(Date.now());
        this.seed = seed;
        try {
            this.core.start_attempt($('trainee').value.trim(), this.started, performance.now() / 1000, seed);
        } catch (error) {
            this.scan.notice(error.message);
            return;
        }
        this.scan.freeze(false);
        this.scan.hints = 0;
        this.scan.say_hint();
        const {exercises, case_name} = this.description;
        this.send([['attempted', {started: this.started, trainee: $('trainee').value.trim(), case_name,
            exercise: exercises[this.exercise].name, title: exercises[this.exercise].title}, null]]);
    }
    async finish_attempt() {
        const {seconds} = this.scan.values;
        const short = seconds < kShortestAttemptS;
        if (short && !await this.ask(t('End this attempt? It has run for %s and will not be kept.', minutes(seconds)), t('Go on'), t('End'))) return;
        if (!short && this.scan.exam() && !await this.ask(t('End this exam? It is scored as it is.'), t('Go on'), t('End'))) return;
        if (!this.attempt_runs()) return;
        if (short) {
            this.core.calls.drop_attempt();
            this.scan.touched();
            return;
        }
        await this.score_attempt();
    }
    // False: it goes on.
    async score_attempt() {
        if (!await this.whole_case(t('Scores need the whole case, which is still loading. The attempt stands still.'))) return false;
        const exercise = this.description.exercises[this.exercise];
        let finished;
        try {
            finished = this.core.finish_attempt();
        } catch (error) {
            this.scan.notice(error.message);
            return false;
        }
        this.attempt = {started: this.started, started_ms: this.started_ms, seed: this.seed, trainee: $('trainee').value.trim(), case_name: this.description.case_name,
            exercise: exercise.name, title: exercise.title || exercise.name, passed: finished.score.passed, exam: this.scan.exam(),
            recording: finished.recording, score_text: finished.score_text};
        this.show_after(finished.score);
        this.kept = [...this.kept ?? [], {...this.attempt, metrics: finished.score.metrics}];
        const sending = this.send([['completed', this.attempt, finished.score], ['scored', this.attempt, finished.score]]);
        this.course?.attempt_done(this.attempt, finished.score);
        const kept = await keep_attempt(this.attempt);
        const sent = await sending;
        $('after-notice').textContent = [
            kept ? '' : `${store_waits() ? `${waiting_words()} ` : ''}${t('This browser keeps nothing: save recording and scores now.')}`,
            words_of_sending(sent),
            ...finished.score.warnings].filter((words) => words).join(' ');
        this.settled = this.started;  // kept and sent, or said that it was not
        return true;
    }
    send(which) {
        if (this.course?.takes(which)) return Promise.resolve({waiting: 0, refused: 0, status: 200});
        const published = this.list?.xapi ?? '';
        const launch = launch_of(location.search, published);
        return send_statements(launch?.endpoint ?? published,
            which.map(([verb, attempt, score]) => statement(verb, attempt, score, launch)),
            launch?.auth || (this.list?.xapi_auth ?? ''));
    }
    // What waited in this browser since an earlier visit, or while there was no network.
    send_waiting() {
        this.send([]).then(({waiting}) => {
            clearTimeout(this.again);
            if (waiting) this.again = setTimeout(() => this.send_waiting(), 60000);
        });
    }

    // As the window's page after an attempt (page_json.h, result_json).
    show_after(score) {
        const result = this.core.result(), exercise = exercise_texts(this.description.exercises[this.exercise]);
        $('after-title').textContent = `${exercise.title || exercise.name} · ${this.scan.exam() ? t('exam') : t('practice')}`;
        $('verdict').textContent = !result.has_marks ? t('Attempt finished') : result.passed ? `✓ ${t('Passed')}` : `✗ ${t('Not passed yet')}`;
        $('verdict').className = !result.has_marks ? '' : result.passed ? 'pass' : 'fail';
        $('why').textContent = [result.marks ? t('%d of %d marks reached.', result.marks_reached, result.marks) : '',
            this.scan.hints ? t('Hints used: %d.', this.scan.hints) : ''].filter((words) => words).join(' ');
        const missed = score.procedure?.items.filter((item) => !item.ticked) ?? [];
        const first = missed.find((item) => item.critical) ?? missed[0];
        $('advice').textContent = first && !score.procedure.passed ? `${t('Missing')}: ${item_title(exercise, first)}. ${missed_words(first.why)}.`
            : result.advice ? t(result.advice) : result.has_marks ? '' : t('This exercise has no pass marks: compare the measures with your own.');
        $('advice-card').hidden = !$('advice').textContent;
        $('marks').replaceChildren(...result.rows.map((one) => {
            const needed = !one.has_limit ? t('No mark for this') : one.none ? t('Needed: none')
                : one.at_least ? t('Needed at least %s', one.limit) : t('Needed at most %s', one.limit);
            const verdict = !one.has_limit ? '' : one.reached ? `✓ ${t('reached')}` : one.measured ? `✗ ${t('not reached')}` : `✗ ${t('not measured')}`;
            return row([t(one.title), one.value, needed, verdict], one.reached ? 'pass' : 'fail');
        }));
        this.show_checklist(score.procedure, exercise);
        this.show_trend(result.trend);
        $('measures').replaceChildren(...result.measures.map((one) => row([t(one.title), one.value])));
        $('next').hidden = this.description.exercises.length < 2;
        const {exercises} = this.description, next = exercise_texts(exercises[(this.exercise + 1) % exercises.length]);
        $('next').textContent = `${t('Next')}: ${next.title || next.name}`;
        $('after-notice').textContent = '';
        this.show('after');
        $('verdict').focus();
    }
    // How the attempts at this exercise went, this one last; the mark as a dashed line.
    show_trend(trend) {
        const {case_name, exercise, started_ms} = this.attempt, before = this.attempts_of(case_name, exercise);
        const values = trend ? [...before.filter((one) => one.started_ms !== started_ms), this.attempt]
            .map((one) => (one.metrics ?? JSON.parse(one.score_text).metrics)?.[trend.metric]).filter(Number.isFinite) : [];
        $('trend-box').hidden = values.length < 2;
        if (values.length < 2) return;
        $('trend-title').textContent = t(trend.title);
        const top = Math.max(...values, trend.limit ?? 0) || 1;
        const x = (n) => 12 + 296 * n / (values.length - 1), y = (value) => 96 - 84 * value / top;
        const draw = (name, properties, text = '') => {
            const one = document.createElementNS('http://www.w3.org/2000/svg', name);
            for (const [key, value] of Object.entries(properties)) one.setAttribute(key, value);
            one.textContent = text;
            return one;
        };
        $('trend').replaceChildren(
            ...trend.limit === null ? [] : [draw('path', {class: 'limit', d: `M12 ${y(trend.limit)}H308`})],
            draw('path', {d: `M${values.map((value, n) => `${x(n)} ${y(value)}`).join('L')}`}),
            ...values.map((value, n) => draw('circle', {cx: x(n), cy: y(value), r: n === values.length - 1 ? 5 : 3})),
            draw('text', {x: 12, y: 116}, '1'), draw('text', {x: 308, y: 116, 'text-anchor': 'end'}, values.length));
        $('trend').setAttribute('aria-label', `${t('Your attempts')}: ${values.map((value) => value.toFixed(2)).join(', ')}`);
    }
    // The list of a procedure, each item with its moment in the recording.
    show_checklist(list, exercise) {
        $('checklist-box').hidden = !list;
        if (!list) return;
        const ticked = list.items.filter((item) => item.ticked).length;
        $('checklist-words').textContent = [t('Checklist: %d of %d, %.0f points of %.0f, %.0f needed', ticked, list.items.length, list.points, list.max_points, list.cut),
            list.stray_acts > list.stray_acts_at_most ? t('%d acts where no step asks for them; at most %d pass.', list.stray_acts, list.stray_acts_at_most) : '',
            ...list.complications.map((one) => `${t(this.description.complications[one.name] ?? one.name)} ${minutes(one.time_s)}`)].filter((words) => words).join(' · ');
        $('checklist').replaceChildren(...list.items.map((item) => {
            const line = row([item_title(exercise, item), item.time_s === null ? '–' : '', item.critical ? t('critical') : '',
                item.ticked ? `✓ ${t('done')}` : `✗ ${missed_words(item.why)}`], item.ticked ? 'pass' : 'fail');
            if (item.time_s === null) return line;
            const moment = element('button', minutes(item.time_s), {type: 'button', title: t('Shows this moment in the replay')});
            moment.addEventListener('click', () => this.show_moment(Math.max(item.time_s - kBeforeS, 0)));
            line.children[1].append(moment);
            return line;
        }));
    }
    // The pictures of the attempt that ended last, held at a time of it.
    show_moment(time_s, plays = false) {
        const back = this.core.calls.look_at_attempt(time_s);
        if (back < 0) return;
        this.show('scan');
        this.scan.look_at_attempt(back, plays);
    }
    save(attempt, what) {
        const name = file_name(attempt);
        if (what === 'recording') download(`${name}.igs.mha`, 'application/octet-stream', attempt.recording);
        else download(`${name}.json`, 'application/json', attempt.score_text);
    }

    async show_scores() {
        this.show('scores');
        $('scores-title').focus();
        const attempts = await kept_attempts().catch(() => null);
        const endpoint = this.list?.xapi ?? '';
        $('scores-words').textContent = [
            attempts ? attempts.length ? '' : t('No attempt yet.') : t('This browser keeps nothing here.'),
            store_waits() ? waiting_words() : '',
            attempts?.some((one) => one.in_page) ? t('Attempts without room are in this page alone: save them before you close it.') : '',
            endpoint ? t('This site sends results to the learning record store at {}.', endpoint) : ''].filter((words) => words).join(' ');
        $('scores-remove').hidden = !attempts?.length;
        $('attempts').replaceChildren(...(attempts ?? []).reverse().map((one) => one.damaged ? this.damaged_line(one) : this.attempt_line(one)));
    }
    attempt_line(attempt) {
        const title = this.title_of_attempt(attempt), when = local_time(attempt.started_ms);
        const line = row([when, attempt.trainee || '–', attempt.case_name, attempt.exam ? `${title} (${t('exam')})` : title,
            attempt.passed ? `✓ ${t('Passed')}` : `✗ ${t('Not passed yet')}`, ''], attempt.passed ? 'pass' : 'fail', {verdict: 4});
        for (const [what, words] of [['recording', t('Recording')], ['scores', t('Scores')]]) {
            const button = element('button', words, {type: 'button'});
            button.setAttribute('aria-label', `${words}: ${title}, ${when}`);
            button.addEventListener('click', () => this.save_kept(attempt, what));
            line.lastElementChild.append(button, ' ');
        }
        return line;
    }
    damaged_line({id}) {
        const line = row(['–', '–', '–', t('Damaged: this attempt cannot be read.'), '', ''], '', {});
        const button = element('button', t('Remove'), {type: 'button'});
        button.addEventListener('click', async () => {
            await remove_attempt(id).catch((error) => console.error(error));
            await this.show_scores();
        });
        line.lastElementChild.append(button);
        return line;
    }
    // In the language in use, where the site or the open case has the exercise still.
    title_of_attempt({case_name, exercise, title}) {
        const entry = this.list?.cases.find((one) => (one.case ?? one.title) === case_name), listed = entry?.exercises.find((one) => one.name === exercise);
        if (listed) return title_of(listed);
        const open = this.description?.case_name === case_name ? this.description.exercises.find((one) => one.name === exercise) : null;
        return (open && exercise_texts(open).title) || title;
    }
    async save_kept(attempt, what) {
        const recording = what === 'recording' ? await recording_of(attempt) : null;
        if (what === 'recording' && !recording) $('scores-words').textContent = t('This recording cannot be read: the browser has lost it.');
        else this.save({...attempt, recording}, what);
    }
    async remove_scores() {
        if (!await this.ask(t('Remove all attempts and recordings from this browser?'), t('Keep'), t('Remove'))) return;
        const removed = await remove_attempts().then(() => true, () => false);
        if (removed) this.course?.remove();
        await this.show_scores();
        if (!removed) $('scores-words').textContent = t('The browser removed nothing. Load the page again, then remove them.');
    }
    frame_shown() {
        this.arriving_case?.pump();
        this.course?.frame_shown();
        if (this.scan.complete) this.work_offline();
    }
    // The service worker fetches page and program again: not before the first picture is there.
    work_offline() {
        const waits = this.scan.shown() && !this.scan.complete;
        if (waits || this.registered || this.list?.package || !('serviceWorker' in navigator) || !location.protocol.startsWith('http') || !isSecureContext) return;
        this.registered = true;
        navigator.serviceWorker.register(`worker.js?program=${program_file()}`).catch(() => {});  // without it the page works online
    }
}

const program_file = () => has_simd() ? 'sonoplay.wasm' : 'sonoplay-scalar.wasm';
const waiting_words = () => t('Another tab has an older page of this site open: close it, so that attempts are kept.');
// "2026-01-31 13:00", by the clock of this device; what is kept has UTC.
function local_time(ms) {
    const two = (n) => String(n).padStart(2, '0'), on = new Date(ms);
    return `${on.getFullYear()}-${two(on.getMonth() + 1)}-${two(on.getDate())} ${two(on.getHours())}:${two(on.getMinutes())}`;
}
// Keys go by their position: where the browser tells what is printed on them, help and tips name that.
async function show_own_keys() {
    try {
        const layout = await navigator.keyboard?.getLayoutMap();
        if (!layout) return;
        for (const one of $('help').querySelectorAll('dt')) one.textContent = key_words(one.textContent, layout);
        for (const one of $('scan').querySelectorAll('[title], #picture'))
            for (const name of ['title', 'aria-label']) if (one.hasAttribute(name)) one.setAttribute(name, key_words(one.getAttribute(name), layout));
    } catch {
        // Not told: the letters of an American keyboard, which the documents have too.
    }
}
async function bytes_of(file, name) {
    try {
        return new Uint8Array(await file.arrayBuffer());
    } catch {
        throw new PlainError(t('{} cannot be read. Choose one file that is on this device.', name));
    }
}

// Titles of what a list of cases and a score name, in the language in use.
function title_of(exercise) { return exercise.titles?.[language_in_use()] || exercise.title || exercise.name; }
function item_title(exercise, item) { return exercise.items?.find((one) => one.name === item.name)?.title || item.title; }
function missed_words(why) {
    return {too_early: t('Too early'), too_late: t('Too late'), happened: t('It happened'), not_tried: t('Not tried'), wrong_answer: t('Answered wrongly'),
        not_answered: t('Not answered')}[why] ?? t('Not done');
}

// places: of the columns that look otherwise.
function row(cells, verdict_class = '', {number, verdict} = {number: 1, verdict: 3}) {
    const line = element('tr');
    cells.forEach((text, n) => line.append(element('td', text, {className: n === number ? 'number' : n === verdict ? verdict_class : ''})));
    return line;
}

async function compile_from(url) {
    const response = await fetch(url);
    if (!response.ok) throw new PlainError(t('The program is missing on this server ({}: {}).', url, response.status));
    const type = response.headers.get('Content-Type') ?? '';
    // A server that does not know the type of .wasm serves it all the same.
    return type.startsWith('application/wasm') ? WebAssembly.compileStreaming(response)
        : WebAssembly.compile(await response.arrayBuffer());
}

$('notice').replaceChildren();  // "This page has not started"
$('notice').classList.remove('unstarted');
await begin_words();
const app = new App();
// For tests, and for pages that embed this one.
globalThis.sonoplay = {
    app,
    words: {missing: missing_words},
    // The last picture: {width, height, pixels: Uint8Array of grey}.
    frame: () => ({width: app.scan.values.width, height: app.scan.values.height, pixels: app.core.pixels().slice()}),
};
app.start().finally(() => app.work_offline());
