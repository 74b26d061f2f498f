// SPDX-License-Identifier: Apache-2.0

// The pages and the ways between them: cases, scanning, after an attempt, scores.
import {Core, PlainError, has_simd} from './core.js';
import {download, file_name, keep_attempt, kept_attempts, launch_of, minutes, remove_attempts, send_statements, set_trainee, statement, trainee, words_of_sending} from './results.js';
import {PoseSource} from './poses.js';
import {ScanPage, element} from './scan.js';
import {ArrivingCase} from './arriving.js';
import {inside_page, load_list, open_bytes} from './source.js';

const $ = (id) => document.getElementById(id);
const kPages = ['start', 'course', 'scan', 'after', 'scores'];

class App {
    constructor() {
        this.scan = new ScanPage(this);
        this.listen();
    }

    listen() {
        const click = (id, what) => $(id).addEventListener('click', what);
        for (const button of document.querySelectorAll('.open-help')) button.addEventListener('click', () => this.help());
        click('open-about', () => $('about').showModal());
        for (const button of document.querySelectorAll('dialog .close')) button.addEventListener('click', () => button.closest('dialog').close());
        click('open-scores', () => this.show_scores());
        click('scores-back', () => this.show('start'));
        click('scores-remove', () => this.remove_scores());
        click('to-cases', () => this.to_cases());
        click('after-cases', () => this.show_first());
        click('again', () => this.choose_exercise(this.exercise));
        click('save-recording', () => this.save(this.attempt, 'recording'));
        click('save-scores', () => this.save(this.attempt, 'scores'));
        click('loading-stop', () => this.loading?.abort());
        click('browse', () => $('file').click());
        $('file').addEventListener('change', () => this.open_file($('file').files[0]));
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
        const asked = new URLSearchParams(location.search);
        if (asked.get('poses')) this.scan.poses = new PoseSource(asked.get('poses'), (words) => this.scan.tracker_says(words));
        const program = this.program();
        program.catch(() => {});  // said below
        try {
            this.list = await load_list();
            this.send_waiting();
            addEventListener('online', () => this.send_waiting());
        } catch (error) {
            this.list = {cases: []};
            this.say(error);
        }
        const ready = program.then(() => { this.ready = true; }, (error) => this.say(error));
        const wanted = this.list.cases.find((one) => one.name === asked.get('case'));
        if (!wanted) this.show_cases();
        if (asked.get('case') && !wanted) this.say(new PlainError(`This site has no case named ${asked.get('case')}.`));
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
                throw new PlainError('This browser has no WebAssembly, which the pictures need. Use a current browser.');
            const name = has_simd() ? 'sonoplay' : 'sonoplay-scalar';
            const inside = inside_page('program');
            try {
                const module = inside ? await WebAssembly.compile(inside) : await compile_from(`${name}.wasm`);
                const core = await Core.create(module);
                performance.mark('program-here');
                return core;
            } catch (error) {
                if (error instanceof PlainError) throw error;
                if (error instanceof RangeError || /memory/i.test(error?.message ?? ''))
                    throw new PlainError('There is not enough memory for the program. Close other pages and load this page again.');
                throw new PlainError('The program did not load. Check the network and load the page again.');
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
        scrollTo(0, 0);
    }
    // A learning platform's trainee came for a module, not for the cases.
    show_first() {
        if (this.course?.single()) this.course.show();
        else this.show('start');
    }
    say(error) {
        console.error(error);
        $('notice').textContent = error instanceof PlainError ? error.message
            : error instanceof WebAssembly.RuntimeError || error instanceof RangeError
                ? 'There is not enough memory for this case. Close other pages and load this page again.'
                : `Something failed that should not: ${error.message}`;
    }

    show_cases() {
        $('cases').replaceChildren(...this.list.cases.map((entry) => {
            const button = element('button', '', {type: 'button'});
            const picture = entry.preview ? element('img', '', {src: entry.preview, alt: '', loading: 'lazy'})
                : element('span', '', {className: 'no-picture'});
            const words = element('span', '', {className: 'words'});
            words.append(element('strong', entry.title), element('span', `${(entry.bytes / 1e6).toFixed(1)} MB`, {className: 'second'}));
            for (const exercise of entry.exercises) words.append(element('span', exercise.title || exercise.name, {className: 'second'}));
            button.append(picture, words);
            button.addEventListener('click', () => this.open(entry));
            const item = element('li');
            item.append(button);
            return item;
        }));
        if (!this.list.cases.length) $('notice').textContent = 'This site holds no case. Open one from a file.';
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
        const part = `${Math.floor(100 * arriving.part)} %`;
        return missing ? `Loading this part of the case: less structure until then (${part})` : `Loading the case: ${part}`;
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
        await this.load(file.name, async (program) => open_bytes(await program, new Uint8Array(await file.arrayBuffer()), file.name), null);
        $('file').value = '';
    }
    // how(program, progress, signal) gives the description of the opened case.
    async load(title, how, exercise) {
        this.loading?.abort();
        this.arriving_case = null;
        const loading = this.loading = new AbortController();
        $('notice').textContent = '';
        $('loading').hidden = false;
        const progress = (part) => {
            $('loading-words').textContent = `Loading ${title}: ${Math.floor(100 * part)} %`;
            $('loading-bar').value = part;
        };
        progress(0);
        try {
            const program = this.program();
            const description = await how(program, progress, loading.signal);
            this.core = await program;
            if (loading.signal.aborted) return;
            performance.mark('case-open');
            this.description = description;
            const index = description.exercises.findIndex((one) => one.name === exercise);
            if (exercise && index < 0) this.scan.notice(`This case has no exercise named ${exercise}.`);
            else this.scan.notice(description.warnings.join(' '));
            this.choose_exercise(Math.max(index, 0));
        } catch (error) {
            if (error.name !== 'AbortError') this.say(error);
        } finally {
            if (this.loading === loading) $('loading').hidden = true;
        }
    }

    async choose_exercise(index) {
        if (this.scan.shown() && this.scan.values.attempt && !await this.ask('Leave this attempt? It will not be kept.', 'Stay', 'Leave')) {
            $('exercise').value = this.exercise;
            return;
        }
        const count = this.description.exercises.length;
        this.exercise = (index % count + count) % count;
        this.show('scan');
        try {
            this.core.choose_exercise(this.exercise, this.scan.side());
            performance.mark('exercise-chosen');
        } catch (error) {
            this.show('start');
            this.say(error);
            return;
        }
        this.scan.show(this.core, this.description, this.exercise);
        $('picture').focus({preventScroll: true});
    }
    async to_cases() {
        if (this.scan.values.attempt && !await this.ask('Leave this attempt? It will not be kept.', 'Stay', 'Leave')) return;
        this.core.calls.drop_attempt();
        this.show_first();
    }
    help() { if (!$('help').open) $('help').showModal(); }
    download(...what) { download(...what); }

    // True for yes.
    ask(words, no, yes) {
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

    // The targets lie elsewhere in each attempt, drawn from a seed that the recording keeps.
    async start_attempt() {
        const {drawn} = this.description.exercises[this.exercise];
        if (drawn && !await this.whole_case('A new place of the target needs the whole case, which is still loading.')) return;
        const asked = Number(new URLSearchParams(location.search).get('seed'));
        const seed = !drawn ? 0 : asked > 0 ? asked : 1 + crypto.getRandomValues(new Uint32Array(1))[0] % 1e9;
        this.started = new Date().toISOString().replace(/\.\d+Z$/, 'Z');
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
        if (seconds < 5 && !await this.ask(`End this attempt? It has run for ${minutes(seconds)} and will not be kept.`, 'Go on', 'End')) return;
        if (seconds < 5) {
            this.core.calls.drop_attempt();
            this.scan.touched();
            return;
        }
        await this.score_attempt();
    }
    async score_attempt() {
        if (!await this.whole_case('Scores need the whole case, which is still loading. The attempt stands still.')) return;
        const exercise = this.description.exercises[this.exercise];
        let finished;
        try {
            finished = this.core.finish_attempt();
        } catch (error) {
            this.scan.notice(error.message);
            return;
        }
        this.attempt = {started: this.started, trainee: $('trainee').value.trim(), case_name: this.description.case_name,
            exercise: exercise.name, title: exercise.title || exercise.name, passed: finished.score.passed, exam: this.scan.exam(),
            recording: finished.recording, score_text: finished.score_text};
        this.show_after(finished.score);
        const sending = this.send([['completed', this.attempt, finished.score], ['scored', this.attempt, finished.score]]);
        this.course?.attempt_done(this.attempt, finished.score);
        const kept = await keep_attempt(this.attempt);
        const sent = await sending;
        $('after-notice').textContent = [
            kept ? '' : 'This browser keeps nothing: save recording and scores now.',
            words_of_sending(sent),
            ...finished.score.warnings].filter((words) => words).join(' ');
        this.settled = this.started;  // kept and sent, or said that it was not
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

    show_after(score) {
        const table = new Map(this.core.metric_words().map((one) => [one.name, one]));
        const with_unit = (name, value) => value === null ? '–' : `${Number(value.toFixed(2))} ${table.get(name)?.unit ?? ''}`.trim();
        const title = (name) => table.get(name)?.title ?? name;
        $('verdict').textContent = !score.pass_marks.length && !score.procedure ? 'Scored' : score.passed ? 'Passed' : 'Not passed yet';
        const failed = score.pass_marks.filter((mark) => !mark.passed).map((mark) => title(mark.metric));
        $('why').textContent = failed.length ? `Not reached: ${failed.join(', ')}.` : '';
        $('marks').replaceChildren(...score.pass_marks.map((mark) => {
            const needed = [mark.at_most === null ? '' : `at most ${with_unit(mark.metric, mark.at_most)}`,
                mark.at_least === null ? '' : `at least ${with_unit(mark.metric, mark.at_least)}`].filter((words) => words).join(', ');
            return row([title(mark.metric), with_unit(mark.metric, mark.value), needed,
                mark.passed ? '✓ reached' : '✗ not reached'], mark.passed ? 'pass' : 'fail');
        }));
        this.show_checklist(score.procedure);
        $('measures').replaceChildren(...Object.entries(score.metrics).map(([name, value]) => row([title(name), with_unit(name, value)])));
        $('after-notice').textContent = '';
        this.show('after');
        $('verdict').focus();
    }
    // The list of a procedure, each item with its moment in the recording.
    show_checklist(list) {
        $('checklist-box').hidden = !list;
        if (!list) return;
        const ticked = list.items.filter((item) => item.ticked).length;
        $('checklist-words').textContent = [`${ticked} of ${list.items.length} items, ${list.points} of ${list.max_points} points, ${list.cut} needed`,
            list.stray_acts > list.stray_acts_at_most ? `${list.stray_acts} acts where no step asks for them; at most ${list.stray_acts_at_most} pass` : '',
            ...list.complications.map((one) => `${one.name.replaceAll('_', ' ')} at ${minutes(one.time_s)}`)].filter((words) => words).join(' · ');
        $('checklist').replaceChildren(...list.items.map((item) => row([item.title, item.time_s === null ? '–' : minutes(item.time_s),
            item.critical ? 'critical' : '', item.ticked ? '✓ done' : `✗ ${item.why.replaceAll('_', ' ')}`], item.ticked ? 'pass' : 'fail')));
    }
    save(attempt, what) {
        const name = file_name(attempt);
        if (what === 'recording') download(`${name}.igs.mha`, 'application/octet-stream', attempt.recording);
        else download(`${name}.json`, 'application/json', attempt.score_text);
    }

    async show_scores() {
        this.show('scores');
        $('scores-title').focus();
        const attempts = await kept_attempts();
        const endpoint = this.list?.xapi ?? '';
        $('scores-words').textContent = [
            attempts ? attempts.length ? '' : 'No attempt yet.' : 'This browser keeps nothing here.',
            endpoint ? `This site sends results to the learning record store at ${endpoint}.` : ''].filter((words) => words).join(' ');
        $('scores-remove').hidden = !attempts?.length;
        $('attempts').replaceChildren(...(attempts ?? []).reverse().map((attempt) => {
            const line = row([attempt.started.replace('T', ' ').replace('Z', ''), attempt.case_name, attempt.exam ? `${attempt.title} (exam)` : attempt.title,
                attempt.passed ? '✓ Passed' : '✗ Not passed yet', '']);
            for (const [what, words] of [['recording', 'Recording'], ['scores', 'Scores']]) {
                const button = element('button', words, {type: 'button'});
                button.setAttribute('aria-label', `${words} of ${attempt.title}, ${attempt.started}`);
                button.addEventListener('click', () => this.save(attempt, what));
                line.lastElementChild.append(button, ' ');
            }
            return line;
        }));
    }
    async remove_scores() {
        if (!await this.ask('Remove all attempts and recordings from this browser?', 'Keep', 'Remove')) return;
        await remove_attempts();
        this.course?.remove();
        await this.show_scores();
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
        navigator.serviceWorker.register('worker.js').catch(() => {});  // without it the page works online
    }
}

function row(cells, last_class = '') {
    const line = element('tr');
    cells.forEach((text, n) => line.append(element('td', text, {className: n === 1 ? 'number' : n === 3 ? last_class : ''})));
    return line;
}

async function compile_from(url) {
    const response = await fetch(url);
    if (!response.ok) throw new PlainError(`The program is missing on this server (${url}: ${response.status}).`);
    const type = response.headers.get('Content-Type') ?? '';
    // A server that does not know the type of .wasm serves it all the same.
    return type.startsWith('application/wasm') ? WebAssembly.compileStreaming(response)
        : WebAssembly.compile(await response.arrayBuffer());
}

const app = new App();
// For tests, and for pages that embed this one.
globalThis.sonoplay = {
    app,
    // The last picture: {side, pixels: Uint8Array of grey}.
    frame: () => ({side: app.scan.values.side, pixels: app.core.pixels().slice()}),
};
app.start().finally(() => app.work_offline());
