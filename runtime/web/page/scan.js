// SPDX-License-Identifier: Apache-2.0

// The scanning page: picture, console, cine and attempts.
import {PlainError} from './core.js';
import {Doppler} from './doppler.js';
import {Hands} from './hands.js';
import {Picture} from './picture.js';
import {minutes} from './results.js';
import {inside_page} from './source.js';
import {View3d} from './view3d.js';
import {exercise_texts, label_words, t} from './words.js';

const kIdleRate = 40;  // pictures per second while nothing moves: tissue breathes, noise changes
const kSliders = 8;
const kLongestStepS = 0.1;   // that held keys move in
const kLongestPauseS = 3;    // between two pictures of a page that is seen
const kCamera = true;  // scripts/web-pack.mjs: false where it was built without
const $ = (id) => document.getElementById(id);
const kAnswer = 9;  // of the kinds of acts
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

export function element(name, text = '', properties = {}) {
    return Object.assign(document.createElement(name), {textContent: text}, properties);
}

// What the hands have done in a procedure, in one line.
// region_words(name): of what a core has taken.
function hands_words(state, region_words) {
    const named = ({region, mm}) => `${region_words(region)} ${mm.toFixed(0)} mm`;
    return [state.injected_ml > 0 ? t('%.0f ml injected', state.injected_ml) : '',
        state.aspirated ? t('Drawn: %s', t(state.aspirated)) : '',
        state.throws ? t('Core: %s', state.taken.filter(({mm}) => mm >= 1).map(named).join(', ') || t('nothing')) : '',
        state.wire_mm > 0 ? t('Wire %.0f mm in', state.wire_mm) : '',
        state.catheter_in ? t('Catheter lies') : '',
        state.drained_ml > 0 ? t('%.0f ml drained', state.drained_ml) : '',
        state.compressed_s > 0 ? t('%.0f s pressed', state.compressed_s) : '',
        ...state.complications.map((words) => t(words))].filter((words) => words).join(' · ');
}

const level_gain = () => ({gain_db: 0, tgc_db: new Array(kSliders).fill(0)});

export class ScanPage {
    // page: app.js, for what leads away from scanning
    constructor(page) {
        this.page = page;
        this.picture = new Picture($('picture-box'), $('picture'), $('overlay'));
        this.console = {...level_gain(), range_db: 60, flip: false};
        this.values = {};
        this.measures = [];
        this.frozen = false;
        this.frames = 0;
        this.put_off = -1;  // the question that was put off last
        this.make_sliders();
        this.listen();
        this.hands = new Hands(this, $('picture'));
        this.doppler = new Doppler(this);
        this.view3d = new View3d(this);
        new ResizeObserver(() => this.fit_later()).observe($('picture-box'));
    }

    make_sliders() {
        for (let n = 0; n < kSliders; ++n) {
            const slider = document.createElement('input');
            Object.assign(slider, {type: 'range', min: -20, max: 20, step: 1, value: 0});
            slider.setAttribute('aria-label', t('Depth gain %d of %d, dB', n + 1, kSliders));
            slider.addEventListener('input', () => this.set_tgc(n, Number(slider.value)));
            slider.addEventListener('dblclick', () => this.set_tgc(n, 0));
            $('tgc').append(slider);
        }
    }

    listen() {
        const click = (id, what) => $(id).addEventListener('click', what);
        click('freeze', () => this.freeze(!this.frozen));
        click('needle', () => this.toggle_needle(true));
        click('needle-across', () => this.toggle_needle(false));
        click('probe-home', () => { this.core.calls.probe_home(); this.touched(); });
        click('attempt', () => this.toggle_attempt());
        click('next-hint', () => this.next_hint());
        click('skip-guide', () => this.skip_guide());
        $('mode').addEventListener('change', () => this.touched());
        for (const name of ['camera', 'usb']) click(name, () => this.toggle_tracker(name));
        click('level', () => this.level());
        click('auto', () => this.auto_gain());
        click('flip', () => this.flip());
        click('measure', () => this.measure(!this.measuring));
        click('save-picture', () => this.save_picture());
        click('full-screen', () => this.full_screen());
        $('cine').addEventListener('input', () => this.look_back(this.values.kept - 1 - Number($('cine').value)));
        $('exercise').addEventListener('change', () => this.page.choose_exercise(Number($('exercise').value)));
        $('model').addEventListener('change', () => this.choose_model($('model').value === 'paper'));
        $('needle-depth').addEventListener('input', () => this.push_to(Number($('needle-depth').value)));
        $('device-tilt').addEventListener('change', (e) => this.device_tilt(e.target));
        this.number('depth', (cm) => this.set_image({depth_mm: 10 * cm}));
        this.number('focus', (cm) => this.set_image({focus_mm: 10 * cm}));
        this.number('gain', (db) => this.set_console({gain_db: db}));
        this.number('range', (db) => this.set_console({range_db: db}));
        document.addEventListener('visibilitychange', () => { this.was_hidden = true; });
    }
    number(id, use) {
        const field = $(id);
        field.addEventListener('change', () => {
            // Any value of the range: the steps are those of the field's own arrows.
            const value = Number(field.value), good = field.value !== '' && value >= Number(field.min) && value <= Number(field.max);
            field.setAttribute('aria-invalid', String(!good));
            if (good) use(value);
            else this.notice(t('%s: from %s to %s.', field.labels[0].textContent, field.min, field.max));
        });
    }

    // core: a case and an exercise of it are open. description: of the case
    show(core, description, exercise) {
        this.core = core;
        if (this.description !== description) {
            this.signature = null;
            $('signed').textContent = '';
        }
        // Another exercise opens as it is meant to look; the same again keeps what the hand has set.
        const other = this.description !== description || this.shown_exercise !== exercise;
        if (other) Object.assign(this.console, level_gain());
        this.description = description;
        this.shown_exercise = exercise;
        this.frozen = this.replays = false;
        this.measures = [];
        this.first_point = null;
        this.measure(false);
        const options = description.exercises.map(exercise_texts).map((one, n) => new Option(one.title || one.name, n));
        $('exercise').replaceChildren(...options);
        $('exercise').value = exercise;
        $('case-title').textContent = description.title;
        $('task-words').textContent = exercise_texts(description.exercises[exercise]).description;
        const number = this.page.attempts_of(description.case_name, description.exercises[exercise].name).length + 1;
        $('attempt-words').textContent = t('Attempt %d · difficulty %d of 5', number, description.exercises[exercise].difficulty);
        this.make_presets();
        this.run_guide(false);
        $('freeze').textContent = t('Freeze');
        this.hints = 0;
        this.say_hint();
        $('mode').value = description.exercises[exercise].mode;
        this.core.set_console(this.console);
        this.values = core.values();
        this.doppler.show();
        this.view3d.show();
        this.fit();
        this.say_console();
        this.last_s = undefined;
        if (!this.running) {
            this.running = true;
            requestAnimationFrame((ms) => this.tick(ms));
        }
        this.touched();
    }
    hide() { this.running = false; }

    // Depth, focus and gain for an organ.
    make_presets() {
        $('presets').replaceChildren(...this.description.presets.map((preset) => {
            const button = element('button', t(preset.name), {type: 'button', title: t(preset.tip)});
            button.addEventListener('click', () => {
                this.set_console(level_gain());
                this.set_image(preset);
            });
            return button;
        }));
    }
    // The first minutes of a newcomer: one thing to do at a time (runtime/tracking/guided_start.h).
    run_guide(runs) {
        this.core.calls.run_guide(runs ? 1 : 0);
        this.guided = '';
        $('guide').hidden = !runs;
    }
    say_guide() {
        if ($('guide').hidden) return;
        const guide = this.core.guide(this.frozen), done = guide.step >= guide.steps;
        if (this.guided === guide.title) return;
        this.guided = guide.title;
        $('guide-step').textContent = t('Step %d of %d', guide.step + 1, guide.steps + 1);
        $('guide-title').textContent = t(guide.title);
        $('guide-words').textContent = t(guide.words);
        $('skip-guide').textContent = done ? t('End') : t('Skip');
    }
    skip_guide() {
        const {step, steps} = this.core.guide(this.frozen);
        if (step >= steps) this.run_guide(false);
        else this.core.calls.skip_guide();
        this.touched();
    }
    shown() { return this.running && !$('scan').hidden; }
    size() { return this.picture.wanted_size(); }

    // The size follows the window once it has stopped changing.
    fit_later() {
        if (!this.shown()) return;
        this.picture.place(this.values, this.doppler.strip_part());
        clearTimeout(this.fitting);
        this.fitting = setTimeout(() => this.shown() && this.fit(), 150);
    }
    fit() {
        const {width, height} = this.size();
        if (width !== this.values.width || height !== this.values.height) this.core.set_image({...this.values, width, height});
        this.values = this.core.values();
        this.picture.place(this.values, this.doppler.strip_part());
        this.touched();
    }

    tick(ms) {
        if (!this.running) return;
        requestAnimationFrame((next) => this.tick(next));
        const now_s = ms / 1000, passed_s = now_s - (this.last_s ?? now_s), seconds = clamp(passed_s, 0, kLongestStepS);
        this.last_s = now_s;
        // A tab in the background and a device asleep draw nothing, and an attempt that waits for its case does not go on:
        // after an hour of it the hands have not moved for an hour, and no time has passed.
        const away = this.was_hidden || passed_s > kLongestPauseS || passed_s < 0;
        if (this.held) this.core.stand_still(passed_s);
        else if (away) this.core.stand_still(passed_s - seconds);
        this.was_hidden = false;
        if (!document.querySelector('dialog[open]')) this.hands.step(seconds);
        if (this.hands.held.size) this.moved = true;
        // An attempt goes on behind a frozen picture, where nobody sees it.
        const unseen = this.frozen && this.values.attempt === 1;
        if ((!this.frozen || unseen) && !this.held) this.take_pose(now_s);
        if (unseen && !this.held && Math.abs(now_s - (this.unseen_s ?? 0)) >= 0.98 / kIdleRate) {
            this.unseen_s = now_s;
            this.core.frame_unseen(now_s);
        }
        if (this.playing) this.play(now_s);
        if (this.held) return;
        this.check_signature();
        const rests = this.frozen || Math.abs(now_s - this.drawn_s) < 0.98 / kIdleRate;
        if (rests && !this.moved) return;
        this.draw(now_s);
    }
    touched() { this.moved = true; }
    // Once all of the case is here, a little with each picture.
    check_signature() {
        if (this.signature || this.values.segments_left) return;
        this.signature = this.core.check_signature();
        if (!this.signature) return;
        const {fit, name, fingerprint} = this.signature;
        $('signed').textContent = fit === 'fits' ? t('Signed by {} (key {}).', name, fingerprint)
            : fit === 'differs' ? t('The signature of {} (key {}) does not fit: the case was changed since, or the signature is that of another.', name, fingerprint)
            : fit === 'unreadable' ? t('The case has a signature that this program cannot read.') : '';
        $('signed').classList.toggle('fail', fit === 'differs' || fit === 'unreadable');
    }
    // A tracker's newest pose moves the tools; hands move them again from there on.
    take_pose(now_s) {
        const poses = (this.camera ?? this.usb ?? this.poses)?.take();
        if (!poses) return;
        this.core.put_tools(now_s, poses.probe, poses.needle, poses.states, poses.tracker);
        this.moved = true;
    }
    tracker_says(words) {
        if (words || this.tracker_said) this.notice(words);
        this.tracker_said = words;
    }

    draw(now_s) {
        this.moved = false;
        this.drawn_s = now_s;
        const before = performance.now();
        this.status = this.frozen ? this.core.calls.frame_again(this.back) : this.core.frame(now_s);
        this.values = this.core.values();
        this.picture.show(this.core.screen(), this.core.overlay(), this.doppler.colours());
        this.doppler.picture_drawn();
        this.view3d.picture_drawn(now_s);
        this.frame_ms = performance.now() - before;
        this.picture.draw_over(this.values, this.flip_sign(), this.exercise().mark_mm, this.measures, this.first_point, this.cross,
            this.shows_targets() ? this.core.targets() : [], this.name_there(), (on) => this.doppler.draw_over(on));
        this.say();
        this.say_guide();
        if (++this.frames === 1) performance.mark('first-picture');
        if (!this.complete && !this.values.missing) {
            this.complete = true;
            performance.mark('complete-picture');
        }
        this.page.frame_shown();
    }

    say() {
        const v = this.values, number = (x, digits, unit) => Number.isFinite(x) ? `${x.toFixed(digits)} ${unit}` : '–';
        const put = (id, text) => { if ($(id).textContent !== text) $(id).textContent = text; };
        const attempt = v.attempt === 1;
        put('arriving', this.page.arriving_words());
        put('value-time', attempt ? minutes(v.seconds) : '–');
        put('value-tip', attempt && v.has_needle && !this.exam() ? number(v.tip_to_target_mm, 1, 'mm') : '–');
        put('value-view', attempt && v.has_needle ? (v.tip_in_view ? t('Yes') : t('No')) : '–');
        put('value-punctures', attempt ? String(v.insertions) : '–');
        put('value-depth', v.has_needle ? number(Math.max(v.needle_depth_mm, 0), 0, 'mm') : '–');
        // Where nothing is asked of a needle, none is spoken of until one is taken.
        const without_needle = this.exercise().kind === 'scan' && v.has_needle !== 1;
        for (const id of ['value-tip', 'value-view', 'value-punctures', 'value-depth'])
            $(id).hidden = $(id).previousElementSibling.hidden = without_needle;
        $('mode').disabled = attempt;
        $('task-words').hidden = attempt;  // read before; its room is for the events
        $('next-hint').disabled = this.exam();
        put('attempt', attempt ? t('Finish attempt') : t('Start attempt'));
        put('needle', v.has_needle ? t('Withdraw') : t('Needle'));
        $('needle-across').disabled = v.has_needle === 1;
        $('recording').hidden = !attempt;
        $('needle-depth').disabled = !v.has_needle;
        if (document.activeElement !== $('needle-depth')) $('needle-depth').value = v.needle_depth_mm;
        if (attempt && this.frames % 10 === 0) this.say_events();
        if (attempt !== !$('procedure').hidden || this.frames % 10 === 0) this.say_procedure(attempt);
        const age = this.frozen ? this.core.calls.kept_age_s(this.back) : 0;
        if (!this.frozen) this.replays = false;
        $('to-results').hidden = !this.replays;
        put('cine-words', this.replays ? `${t('Replay')} ${minutes(Math.max(this.core.calls.kept_age_s(v.kept - 1) - age, 0))}` : this.frozen ? t('FROZEN %.1f s ago', age) : t('Live, last 20 s'));
        $('cine').disabled = !this.frozen;
        $('cine').max = Math.max(v.kept - 1, 0);
        $('cine').value = Math.max(v.kept - 1, 0) - (this.back ?? 0);
    }
    say_events() {
        const words = this.core.attempt_words();
        if (words.join() === this.events_said) return;
        this.events_said = words.join();
        $('events').replaceChildren(...words.map((line) => element('li', this.words_of_event(line))));
    }
    // What the program says of an event, [format, argument, ...] (page_json.h), in the language in use.
    words_of_event([format, ...values]) {
        const said = ([words, ...inner]) => {
            const label = this.description.labels.find((one) => one.english === words);
            const step = this.core.procedure()?.steps.findIndex((one) => one.title === words) ?? -1;
            if (label && /^(Touched|Left)/.test(format)) return label_words(label);
            if (step >= 0 && format.startsWith('Done')) return exercise_texts(this.exercise()).steps?.[step]?.title || words;
            // A target's name is the author's.
            return inner.length > 0 || words === 'a structure' ? t(words, ...inner.map(said)) : words;
        };
        return t(format, ...values.map(said));
    }
    // Steps, question and tray of a procedure; rebuilt only when something of them has changed, so that a control in
    // focus stays.
    say_procedure(attempt) {
        const state = attempt ? this.core.procedure() : null;
        $('procedure').hidden = !state;
        if (!state) {
            this.procedure_said = '';
            this.put_off = -1;
            return;
        }
        $('hands-words').textContent = hands_words(state, (region) => this.words_of_label(region));
        // Those that wait for an answer; one that was put off comes back with the next answer.
        const {present, tray} = state, texts = exercise_texts(this.exercise());
        const steps = state.steps.map((step, n) => ({...step, ...texts.steps?.[n]}));
        const questions = state.questions.map((one) => ({...one, words: texts.items?.[one.item]?.question || one.words,
            options: texts.items?.[one.item]?.options?.length ? texts.items[one.item].options : one.options}));
        const question = questions.find((one) => one.item > this.put_off);
        const said = JSON.stringify([steps, present, questions, this.put_off, tray, this.exam()]);
        if (said === this.procedure_said) return;
        this.procedure_said = said;
        const kMark = {done: '✓', too_early: '!', too_late: '!', missed: '!'};
        $('steps').hidden = this.exam();
        $('step-words').hidden = this.exam();
        $('steps').replaceChildren(...steps.map((step) => {
            const line = element('li', `${kMark[step.state] ?? ''} ${step.title}`.trim(), {className: step.state});
            if (step.state === 'present') line.setAttribute('aria-current', 'step');
            return line;
        }));
        $('step-words').textContent = steps[present]?.instruction ?? (steps.length ? t('All steps are behind you: finish the attempt.') : '');
        $('question').hidden = !questions.length;
        $('question-words').textContent = question?.words ?? t('A question waits');
        const button = (words, act) => {
            const one = element('button', words, {type: 'button'});
            one.addEventListener('click', () => this.perform(act));
            return one;
        };
        const choice = (words, put_off, title) => {
            const one = element('button', words, {type: 'button', title});
            one.addEventListener('click', () => { this.put_off = put_off; this.say_procedure(true); });
            return one;
        };
        $('options').replaceChildren(
            ...(question?.options ?? []).map((words, n) => button(words, {kind: kAnswer, index: question.item, amount: n})),
            question ? choice(t('Later'), question.item, t('It is asked again when the next question is answered')) : choice(t('Show it'), -1, ''));
        $('tray').replaceChildren(...tray.map((act) => button(t(act.words), act)));
        this.tray = tray;
    }
    perform(act) {
        if (act.kind === kAnswer) this.put_off = -1;
        if (!this.core.act(act)) this.notice(t('Too many acts at once: wait a moment.'));
        this.touched();
    }
    // By its place on the tray.
    perform_nth(n) { if (this.values.attempt && this.tray?.[n]) this.perform(this.tray[n]); }
    say_console() {
        $('depth').value = this.values.depth_mm / 10;
        $('focus').value = this.values.focus_mm / 10;
        $('gain').value = Math.round(this.console.gain_db * 10) / 10;
        $('range').value = this.console.range_db;
        $('model').value = this.values.model_paper ? 'paper' : 'physical';
        for (const id of ['depth', 'focus', 'gain', 'range']) $(id).setAttribute('aria-invalid', 'false');
        [...$('tgc').children].forEach((slider, n) => { slider.value = this.console.tgc_db[n]; });
        $('flip').setAttribute('aria-pressed', String(this.console.flip));
    }
    exercise() { return this.description.exercises[Number($('exercise').value)]; }
    exam() { return $('mode').value === 'exam'; }
    next_hint() {
        if (this.exam()) return;
        this.hints = Math.min(this.hints + 1, this.exercise().hints.length + 1);
        this.say_hint();
        this.touched();
    }
    // After the last hint the targets themselves.
    shows_targets() { return !this.exam() && this.hints > this.exercise().hints.length; }
    // What lies under the pointer; nothing in an exam, and while something is dragged.
    name_there() {
        const at = this.hands.pointer;
        if (!at || this.exam() || this.measuring) return null;
        const rect = $('picture').getBoundingClientRect(), px = this.values.width / rect.width;
        const name = this.core.name_at(Math.floor((at.x - rect.left) * px), Math.floor((at.y - rect.top) * px));
        return name && {...at, words: this.words_of_label(name)};
    }
    // The name that an author gave stays as it is.
    words_of_label(name) {
        const label = this.description.labels.find((one) => one.name === name);
        return label ? label_words(label) : name;
    }
    say_hint() {
        const {hints} = exercise_texts(this.exercise()), said = this.hints > 0;
        $('hint').hidden = !said;
        $('hint').textContent = !said ? '' : this.hints > hints.length ? t('The target is shown.') : `${t('Hint %d of %d', this.hints, hints.length)}: ${hints[this.hints - 1]}`;
    }
    notice(text) { $('bar-notice').textContent = text; }

    set_image(change) {
        const v = this.values;
        const image = {model_paper: v.model_paper, width: v.width, height: v.height, depth_mm: v.depth_mm, focus_mm: v.focus_mm, ...change};
        image.depth_mm = clamp(image.depth_mm, 30, 300);
        image.focus_mm = clamp(image.focus_mm, 10, image.depth_mm);
        try {
            this.core.set_image(image);
        } catch (error) {
            this.notice(error.message);
            if (change.model_paper && v.segments_left) this.later_paper();
        }
        this.freeze(false);
        this.values = this.core.values();
        this.say_console();
    }
    // The textures of the plain picture come late.
    later_paper() {
        this.notice(t('The plain picture is shown as soon as the case has loaded.'));
        const core = this.core, description = this.description;
        this.page.arriving_case.whole.then(() => {
            if (this.core !== core || this.description !== description) return;
            this.notice('');
            this.choose_model(true);
        }, () => {});
    }
    choose_model(paper) { this.set_image({model_paper: paper}); }
    set_console(change) {
        Object.assign(this.console, change);
        this.core.set_console(this.console);
        this.say_console();
        this.touched();
    }
    set_tgc(slider, db) {
        this.console.tgc_db[slider] = clamp(db, -20, 20);
        this.set_console({});
    }
    level() { this.set_console({tgc_db: level_gain().tgc_db}); }
    auto_gain() { if (this.status === 0) this.set_console(this.core.adjusted_gain()); }
    flip() { this.set_console({flip: !this.console.flip}); }
    flip_sign() { return this.console.flip ? -1 : 1; }
    mm_per_css_px() { return this.values.mm_per_px / this.picture.css_per_px; }

    freeze(frozen) {
        this.frozen = frozen && this.values.kept > 0;
        this.back = 0;
        this.playing = false;
        $('freeze').textContent = this.frozen ? t('Live') : t('Freeze');
        this.touched();
    }
    // What the program keeps are the pictures of the attempt that ended last, until it goes on live.
    look_at_attempt(back, plays) {
        this.values = this.core.values();
        this.look_back(back);
        this.playing = plays;
        this.replays = true;
        $('freeze').textContent = t('Live');
        if (this.running) return;
        this.running = true;
        requestAnimationFrame((ms) => this.tick(ms));
    }
    look_back(back) {
        if (!this.frozen) this.freeze(true);
        this.back = clamp(back, 0, Math.max(this.values.kept - 1, 0));
        this.touched();
    }
    play(now_s) {
        const until_next = this.back > 0 ? this.core.calls.kept_age_s(this.back) - this.core.calls.kept_age_s(this.back - 1) : 0;
        if (now_s - this.drawn_s < 0.98 * clamp(until_next, 1 / 60, 1)) return;
        this.look_back(this.back > 0 ? this.back - 1 : this.values.kept - 1);
    }

    toggle_needle(in_plane) {
        const calls = this.core.calls;
        if (this.values.has_needle) calls.withdraw_needle();
        else if (!calls.take_needle(in_plane ? 1 : 0)) this.notice(t('There is no skin beside the probe to put the needle on.'));
        this.touched();
    }
    // A long press: the needle, aimed at that place, while it is outside. One that is in stays: fingers rest.
    bring_needle(client_x, client_y) {
        if (this.values.has_needle !== 1 || this.values.needle_depth_mm <= 0) this.needle_to(client_x, client_y);
    }
    needle_to(client_x, client_y) {
        const at = this.picture.mm_at(client_x, client_y, this.values);
        if (!this.core.calls.needle_to(this.flip_sign() * at.x, at.z))
            this.notice(t('There is no skin beside the probe to put the needle on.'));
        this.touched();
    }
    push_to(mm) {
        this.core.calls.advance_needle(mm - this.values.needle_depth_mm);
        this.touched();
    }
    // The tracker of a button: its part of the page and its program are fetched here, and the user is asked. `name`: camera or
    // usb; one at a time.
    async toggle_tracker(name) {
        const show = (tracker) => {
            this[name] = tracker;
            $(name).setAttribute('aria-pressed', String(tracker !== null));
            $(`${name}-room`).hidden = tracker === null;
        };
        if (this[name]) {
            this[name].stop();
            show(null);
            return;
        }
        const other = name === 'camera' ? 'usb' : 'camera';
        if (this[other]) await this.toggle_tracker(other);
        this.notice('');
        try {
            if (name === 'camera' && !kCamera) throw new PlainError(t('This page was built without the camera.'));
            if (inside_page('program')) throw new PlainError(name === 'camera' ? t('A page in one file cannot use the camera: open the site instead.') : t('A page in one file cannot use a tracker on USB: open the site instead.'));
            const {CameraTracker, UsbTracker} = await (name === 'camera' ? import('./camera.js') : import('./usb.js')).catch(() => {
                throw new PlainError(name === 'camera' ? t('The program of the camera did not load. Check the network, then press Camera again.')
                    : t('The program of the tracker did not load. Check the network, then press USB tracker again.'));
            });
            if (this[name]) return;  // pressed twice
            const ended = (words) => { show(null); this.notice(words); };
            const tracker = new (CameraTracker ?? UsbTracker)(this, $(`${name}-room`), ended);
            show(tracker);
            await tracker.start();
        } catch (error) {
            this[name]?.stop();
            show(null);
            if (!(error instanceof PlainError)) throw error;
            this.notice(error.message);
        }
    }
    async device_tilt(box) {
        if (box.checked && !await this.hands.use_tilt(true)) {
            box.checked = false;
            this.notice(t('This device does not tell its tilt, or you did not allow it.'));
        } else if (!box.checked) {
            this.hands.use_tilt(false);
        }
    }

    measure(on) {
        this.measuring = on;
        this.first_point = this.cross = null;
        $('measure').setAttribute('aria-pressed', String(on));
        this.touched();
    }
    measure_at(client_x, client_y) {
        const at = this.picture.mm_at(client_x, client_y, this.values);
        this.measure_point({x: at.x * this.flip_sign(), z: at.z});
    }
    // By keys: a cross that the arrows move, from the middle of the picture on, and Enter sets a point where it is.
    move_cross(across_mm, deeper_mm) {
        const {width, height, mm_per_px, origin_x, origin_y, depth_mm} = this.values, flip = this.flip_sign();
        const at = this.cross ?? {x: 0, z: depth_mm / 2}, shown_x = flip * at.x + across_mm;
        this.cross = {x: flip * clamp(shown_x, -origin_x * mm_per_px, (width - 1 - origin_x) * mm_per_px),
            z: clamp(at.z + deeper_mm, -origin_y * mm_per_px, (height - 1 - origin_y) * mm_per_px)};
        this.touched();
    }
    measure_point(at) {
        if (this.first_point) {
            this.measures = [...this.measures, [this.first_point, at]].slice(-2);
            this.first_point = null;
        } else {
            this.first_point = at;
        }
        this.touched();
    }
    clear() {
        this.measures = [];
        this.first_point = null;
        this.touched();
    }
    save_picture() {
        $('picture').toBlob((blob) => this.page.download('sonocase.png', 'image/png', blob));
    }
    full_screen() {
        if (document.fullscreenElement) document.exitFullscreen();
        else document.documentElement.requestFullscreen?.().catch(() => this.notice(t('This browser does not allow full screen.')));
    }

    toggle_attempt() {
        if (this.values.attempt) this.page.finish_attempt();
        else this.page.start_attempt();
    }
}
