// SPDX-License-Identifier: Apache-2.0

// What a trainee has of a course's module, kept in this browser and by the learning platform that opened the page:
// SCORM 1.2 (API), SCORM 2004 (API_1484_11), cmi5, or none. Without a platform the browser alone keeps it. Whatever
// the platform does not take (no network, a session that is over) waits here and is handed over at the next chance,
// also by a later launch. docs/browser.md names the rules that are kept.

import {new_id} from './results.js';

const kMostLetters = 4000;  // of suspend_data: SCORM 1.2 promises 4,096
const kAgainMs = 15000;     // between tries to hand over what waits
const kPatienceMs = 20000;  // a platform that has not answered by then is asked again later

// What the code here needs of a browser; tests give their own.
function this_browser() {
    const storage = (of) => {
        try {
            return globalThis[of] ?? null;
        } catch {
            return null;  // forbidden, as in some frames
        }
    };
    return {window: globalThis, fetch: (...what) => globalThis.fetch(...what), local: storage('localStorage'), session: storage('sessionStorage'),
        locks: globalThis.navigator?.locks, now_ms: () => Date.now(), id: () => new_id(), page: location.href};
}
function read_kept(storage, key) {
    try {
        return storage?.getItem(key) ?? null;
    } catch {
        return null;
    }
}
// False: nothing is kept.
function write_kept(storage, key, text) {
    try {
        if (!storage) return false;
        if (text === null) storage.removeItem(key);
        else storage.setItem(key, text);
        return true;
    } catch {
        return false;
    }
}

// The state of a module: {phase, option, attempts: [{started_ms: since 1970, passed, exam}], value: the practised measure
// in the last attempt, told: the day on which a platform was told of the pass}. Of SCORM, which gives an attempt at a
// module no name of its own: copy, such a name; handed: when the newest attempt that the platform has began, 0 if it has
// none, -1 if it has nothing, null where that was not noted. As text: attempts as milliseconds since the one before, in
// base 36, and a letter: P F passed or failed, X Y the same in an exam.
const kLetters = ['F', 'P', 'Y', 'X'];
export function new_module_state() { return {phase: 'question', option: -1, attempts: [], value: null, told: '', copy: '', handed: null}; }
const by_time = (x, y) => x.started_ms - y.started_ms;
// more: for this browser alone.
export function module_text(state, more = {}) {
    // A clock that was set back makes a later attempt the earlier one.
    const attempts = [...state.attempts].sort(by_time);
    for (let from = 0;; ++from) {
        let before = 0, packed = '';
        for (const {started_ms, passed, exam} of attempts.slice(from)) {
            packed += (started_ms - before).toString(36) + kLetters[(passed ? 1 : 0) + (exam ? 2 : 0)];
            before = started_ms;
        }
        const text = JSON.stringify({v: 2, p: state.phase, o: state.option, a: packed, x: state.value, t: state.told, ...state.copy ? {c: state.copy} : {}, ...more});
        // The oldest attempts go first: the gate looks at the last ones, and `told` keeps the pass.
        if (text.length <= kMostLetters) return text;
    }
}
// Null: it is no such text.
export function module_state(text) {
    let kept;
    try {
        kept = JSON.parse(text);
    } catch {
        return null;
    }
    const unit_ms = {1: 1000, 2: 1}[kept?.v];
    if (!unit_ms || typeof kept.a !== 'string' || !/^(-?[0-9a-z]+[FPYX])*$/.test(kept.a)) return null;
    const state = new_module_state();
    if (['question', 'text', 'expert', 'practice'].includes(kept.p)) state.phase = kept.p;
    if (Number.isInteger(kept.o) && kept.o >= 0 && kept.o < 4) state.option = kept.o;
    if (Number.isFinite(kept.x)) state.value = kept.x;
    if (typeof kept.t === 'string') state.told = kept.t;
    if (typeof kept.c === 'string') state.copy = kept.c.slice(0, 36);
    if (Number.isFinite(kept.h)) state.handed = kept.h;
    let started_ms = 0;
    // Earlier versions wrote attempts as they came, also from a clock that was set back.
    for (const [, delta, letter] of kept.a.matchAll(/(-?[0-9a-z]+)([FPYX])/g)) {
        started_ms += unit_ms * parseInt(delta, 36);
        const at = kLetters.indexOf(letter);
        state.attempts.push({started_ms, passed: at % 2 === 1, exam: at > 1});
    }
    state.attempts.sort(by_time);
    return state;
}
// Two copies of one trainee's module: nothing of either is lost.
export function merged_states(a, b) {
    if (!a || !b) return a ?? b;
    const kPhases = ['question', 'text', 'expert', 'practice'];
    const of_a = new Set(a.attempts.map((one) => one.started_ms));
    const attempts = [...a.attempts, ...b.attempts.filter((one) => !of_a.has(one.started_ms))].sort(by_time);
    const newest = (b.attempts.at(-1)?.started_ms ?? 0) > (a.attempts.at(-1)?.started_ms ?? 0) ? b : a;
    return {phase: kPhases[Math.max(kPhases.indexOf(a.phase), kPhases.indexOf(b.phase))], option: a.option >= 0 ? a.option : b.option,
        attempts, value: newest.value, told: a.told || b.told, copy: a.copy || b.copy, handed: a.handed ?? b.handed};
}
// Of a state that this browser kept, what its platform was never given; null: nothing.
function never_handed(state) {
    if (state.handed === null) return state.told ? null : state;  // an earlier version did not note it
    if (state.handed < 0) return state;
    const attempts = state.attempts.filter((one) => one.started_ms > state.handed);
    return attempts.length ? {...new_module_state(), phase: state.phase, option: state.option, attempts, value: state.value, handed: -1} : null;
}

// One tab alone writes what is kept under a name. on_mine is called once this tab has it, at once or when the other
// tab lets go; on_other once if another has it.
export function hold_alone(name, on_mine, on_other, browser = this_browser()) {
    const {locks} = browser;
    if (!locks) {
        hold_lease(name, on_mine, on_other, browser);
        return;
    }
    const ask = (options, mine) => {
        let answered = false;
        const refused = (error) => {
            if (answered) console.error(error);  // of what follows from the answer
            else hold_lease(name, on_mine, on_other, browser);
        };
        // Frames of another site, and browsers that keep nothing, may have locks and refuse them.
        try {
            Promise.resolve(locks.request(name, options, (lock) => {
                answered = true;
                return mine(lock);
            })).catch(refused);
        } catch (error) {
            refused(error);
        }
    };
    const hold = () => {
        on_mine();
        return new Promise(() => {});  // held until the page is gone
    };
    ask({ifAvailable: true}, (lock) => {
        if (lock) return hold();
        on_other();
        ask({}, hold);
        return undefined;
    });
}
// Without locks, as in pages that are not secure: a lease in storage, renewed while the page lives.
function hold_lease(name, on_mine, on_other, browser) {
    const {local, now_ms, window} = browser;
    if (!local) {
        on_mine();
        return;
    }
    const kRenewMs = 2000, kLeaseMs = 3 * kRenewMs, key = `sonocase-lease ${name}`, me = browser.id();
    let held = false, told = false;
    const look = () => {
        let lease = null;
        try {
            lease = JSON.parse(read_kept(local, key) ?? 'null');
        } catch {
            // damaged: nobody's
        }
        const others = lease && lease.id !== me && lease.until > now_ms();
        if (others && held) held = false;  // this tab stood still for so long that another took over
        if (others && !told) on_other();
        told = Boolean(others);
        if (others) return;
        write_kept(local, key, JSON.stringify({id: me, until: now_ms() + kLeaseMs}));
        if (!held) on_mine();
        held = true;
    };
    look();
    window.setInterval(look, kRenewMs);
    window.addEventListener?.('pagehide', () => { if (held) write_kept(local, key, null); });
}

const words_of_seconds = (seconds) => `PT${Math.max(0, seconds).toFixed(2)}S`;
// "0000:00:00.00" of SCORM 1.2.
function clock_of_seconds(seconds) {
    const hundredths = Math.round(100 * Math.max(0, seconds));
    const two = (x) => String(x).padStart(2, '0');
    return `${String(Math.floor(hundredths / 360000)).padStart(4, '0')}:${two(Math.floor(hundredths / 6000) % 60)}:${two(Math.floor(hundredths / 100) % 60)}.${two(hundredths % 100)}`;
}

// The object that a platform of SCORM puts into a window above this one or into the one that opened it; null: none.
export function find_api(window, name) {
    const look_up = (from) => {
        for (let n = 0; from && n < 500; ++n) {
            try {
                if (from[name]) return from[name];
                if (!from.parent || from.parent === from) return null;
                from = from.parent;
            } catch {
                return null;  // a window of another site
            }
        }
        return null;
    };
    return (window.parent && window.parent !== window && look_up(window.parent)) || (window.opener && look_up(window.opener)) || null;
}

class NoPlatform {
    learner = '';
    words = '';
    // What it keeps of the module, null for nothing; undefined: it has not answered, and on_state is called once it has.
    // Before the first pause it is known who the learner is.
    async begin() { return null; }
    save() {}
    attempted() {}
    async hand_over() {}
    waiting() { return 0; }
    async end() { return ''; }
    leave() {}
}

// SCORM: calls that either work or say why.
class Scorm extends NoPlatform {
    constructor(is_2004, browser) {
        super();
        Object.assign(this, {is_2004, browser, api: find_api(browser.window, is_2004 ? 'API_1484_11' : 'API'), open: false, dirty: false});
    }
    call(name, ...what) {
        try {
            return String(this.api[this.is_2004 ? name : `LMS${name}`](...what));
        } catch {
            return 'false';  // the platform's own script failed
        }
    }
    code() { return Number(this.call('GetLastError')); }
    get(name) {
        const value = this.call('GetValue', name);
        return this.code() === 0 ? value : '';
    }
    set(name, value) { return this.call('SetValue', name, String(value)) === 'true'; }

    async begin() {
        if (!this.api) {
            this.words = 'no_platform';
            return null;
        }
        const begun = this.call('Initialize', '');
        const code = begun === 'true' ? 0 : this.code();
        // A page that is loaded again may find its session still open.
        const still_open = begun !== 'true' && this.call('GetValue', this.name('learner')) !== '' && this.code() === 0;
        // A session that is over does not say whose it was; this tab knows from before.
        const learner_key = `sonocase-learner ${this.browser.page}`;
        this.learner = this.get(this.name('learner')) || read_kept(this.browser.session, learner_key) || '';
        write_kept(this.browser.session, learner_key, this.learner);
        if (begun !== 'true' && !still_open) {
            this.words = 'session_over';
            console.error(`Initialize: ${code} ${this.call('GetErrorString', String(code))}`);
            return null;
        }
        this.open = true;
        this.begun_ms = this.browser.now_ms();
        const mode = this.get(this.is_2004 ? 'cmi.mode' : 'cmi.core.lesson_mode');
        this.judged = !mode || mode === 'normal';
        const status = this.get(this.name('status'));
        if (this.judged && ['', 'unknown', 'not attempted'].includes(status)) this.set(this.name('status'), 'incomplete');
        this.set(this.is_2004 ? 'cmi.exit' : 'cmi.core.exit', 'suspend');
        const text = this.get('cmi.suspend_data') || null;
        // A new attempt, as after the first was reset: what this browser kept of an earlier one is not its.
        this.fresh = !text && this.get(this.is_2004 ? 'cmi.entry' : 'cmi.core.entry') === 'ab-initio';
        return text;
    }
    name(what) {
        return {learner: ['cmi.core.student_id', 'cmi.learner_id'], status: ['cmi.core.lesson_status', 'cmi.completion_status'],
            place: ['cmi.core.lesson_location', 'cmi.location'], time: ['cmi.core.session_time', 'cmi.session_time']}[what][this.is_2004 ? 1 : 0];
    }
    // part: of the gate, 1 once it is passed.
    save(text, place, part, passed) {
        Object.assign(this, {text, place, part, passed, dirty: true});
        this.hand_over();
    }
    async hand_over() {
        if (!this.open || !this.dirty) return;
        // Some platforms refuse a value and commit all the same.
        let taken = this.set('cmi.suspend_data', this.text);
        this.set(this.name('place'), this.place);
        if (this.judged) taken = this.tell_standing() && taken;
        this.tell_time();
        this.dirty = !(this.call('Commit', '') === 'true' && taken);
        if (!this.dirty) this.on_handed?.();
    }
    tell_time() {
        const seconds = (this.browser.now_ms() - this.begun_ms) / 1000;
        this.set(this.name('time'), this.is_2004 ? words_of_seconds(seconds) : clock_of_seconds(seconds));
    }
    // The score is set once it is a pass: platforms take a lower one for a failed module and close it, though the trainee
    // is only under way. How far that is goes where no status follows from it. False: the pass was refused.
    tell_standing() {
        const all = (prefix, values, needed) => values.map(([name, value]) => this.set(prefix + name, value) || !needed.includes(name)).every((one) => one);
        if (this.is_2004) {
            this.set('cmi.progress_measure', Number(this.part.toFixed(4)));
            return !this.passed || all('cmi.', [['score.scaled', 1], ['score.raw', 100], ['score.min', 0], ['score.max', 100], ['success_status', 'passed'], ['completion_status', 'completed']],
                ['score.scaled', 'success_status', 'completion_status']);
        }
        if (this.get('cmi.objectives._children')) {
            this.set('cmi.objectives.0.id', 'gate');
            this.set('cmi.objectives.0.score.raw', Math.round(100 * this.part));
            this.set('cmi.objectives.0.status', this.passed ? 'passed' : 'incomplete');
        }
        return !this.passed || all('cmi.core.', [['score.raw', 100], ['score.min', 0], ['score.max', 100], ['lesson_status', 'passed']], ['score.raw', 'lesson_status']);
    }
    waiting() { return this.dirty ? 1 : 0; }
    async end() {
        this.leave();
        return '';
    }
    leave() {
        if (!this.open) return;
        if (this.text) {
            this.dirty = true;
            this.hand_over();
        } else {
            this.tell_time();
        }
        this.open = this.call(this.is_2004 ? 'Terminate' : 'Finish', '') !== 'true';
    }
}

// Of a learner's languages, such as "de-DE,en", the first that there is; "": none.
export function preferred_language(list, there) {
    for (const wanted of String(list ?? '').toLowerCase().split(',').map((one) => one.trim())) {
        const found = there.find((code) => wanted === code || wanted.startsWith(`${code}-`));
        if (found) return found;
    }
    return '';
}

const kCmiContext = 'https://w3id.org/xapi/cmi5/context/';
const kCmiVerbs = {initialized: 'http://adlnet.gov/expapi/verbs/initialized', terminated: 'http://adlnet.gov/expapi/verbs/terminated',
    passed: 'http://adlnet.gov/expapi/verbs/passed', failed: 'http://adlnet.gov/expapi/verbs/failed', completed: 'http://adlnet.gov/expapi/verbs/completed'};
const is_good = (status) => status >= 200 && status < 300;
const kOfOneSession = [kCmiVerbs.initialized, kCmiVerbs.terminated, kCmiVerbs.failed];

class CmiPlatform extends NoPlatform {
    // store: the record store that the package was made for; "": the one that the launch names.
    constructor(browser, store) {
        super();
        const asked = new URL(browser.page).searchParams;
        Object.assign(this, {browser, store, dirty: false, refused: 0, keeps_queue: true, early: new Set(), early_scored: 0, launch: Object.fromEntries(
            ['endpoint', 'fetch', 'actor', 'registration', 'activityId'].map((name) => [name, asked.get(name) ?? '']))});
    }
    async begin() {
        const {launch, browser} = this;
        try {
            this.actor = JSON.parse(launch.actor || 'null');
        } catch {
            this.actor = null;
        }
        const missing = Object.keys(launch).filter((name) => !launch[name]);
        if (missing.length === 5) {
            this.words = 'no_platform';
            return null;
        }
        if (missing.length || !this.actor) {
            this.words = 'bad_launch';
            console.error(`the launch lacks ${missing.join(', ') || 'a readable actor'}`);
            return null;
        }
        this.learner = `${JSON.stringify(this.actor.account ?? this.actor)} ${launch.registration}`;
        this.unit = `${launch.registration} ${launch.activityId}`;
        this.queue_key = `sonocase-waiting ${this.unit}`;
        // The key is given once; a page that is loaded again has it from before.
        this.session_key = `sonocase-cmi5 ${launch.fetch}`;
        try {
            this.session = JSON.parse(read_kept(browser.session, this.session_key) ?? 'null');
        } catch {
            this.session = null;
        }
        Object.assign(this, {words: 'asking', asks: true, has_state: false});
        await this.hand_over();
        if (this.words === 'asking') this.words = this.open ? '' : 'no_answer';
        return undefined;
    }
    // The steps of a launch, each asked for again later until the platform has answered. `open` once statements may be
    // sent, `has_state` once it is known what the platform keeps: what was never read must not be written over, and may
    // hold a pass that was told before.
    async connect() {
        const {browser} = this;
        if (!this.session) {
            const token = await this.fetch_token();
            if (!token) return;
            this.session = {token, begun_ms: browser.now_ms(), initialized: false, attempts: 0};
            this.keep_session();
        }
        if (!this.open && !await this.open_session()) return;
        const {status, text} = await this.read_document('activities/state', {stateId: 'sonocase.module'});
        this.last_status = status;
        if (status !== 404 && !is_good(status)) return;
        this.asks = false;
        this.has_state = true;
        this.on_state?.(is_good(status) && text ? text : null);
    }
    async open_session() {
        const {status, text} = await this.read_document('activities/state', {stateId: 'LMS.LaunchData'});
        try {
            if (is_good(status)) this.session.data = JSON.parse(text);
        } catch {
            // said below
        }
        // A page loaded again without a network goes on with what it knew.
        if (!this.session.data?.contextTemplate) {
            this.words = status === 404 || is_good(status) ? 'no_launch_data' : status === 401 || status === 403 ? 'key_expired' : 'no_answer';
            this.asks = status !== 404;
            return false;
        }
        this.keep_session();
        this.judged = (this.session.data.launchMode ?? 'Normal') === 'Normal';
        if (is_good(status) && await this.read_preferences()) return false;
        if (!this.judged) {
            // What was done while this was not known, and what waits for a session that is judged.
            this.set_queue(this.queue().filter((one) => !this.early.has(one.id)));
            Object.assign(this, {queue_key: `sonocase-looking ${this.unit}`, in_page: null, keeps_queue: true, dirty: false});
            this.on_unjudged?.();
        }
        this.open = true;
        this.words = '';
        if (this.judged) this.session.attempts += this.early_scored;
        this.early_scored = 0;
        const left = this.queue();
        if (this.session.initialized) {
            this.set_queue(left.map((one) => one.context?.registration ? one : {...one, context: this.context(one)}));
            return true;
        }
        this.set_queue([]);
        this.queue_statement(this.defined('initialized'));
        this.session.initialized = true;
        this.keep_session();
        // Statements of a session that broke off, and of this one before it was open, go with it.
        for (const statement of left) {
            if (!kOfOneSession.includes(statement.verb.id)) this.queue_statement({...statement, context: this.context(statement)});
        }
        return true;
    }
    // True: the page is loaded again in the learner's language.
    async read_preferences() {
        const {status, text} = await this.read_document('agents/profile', {profileId: 'cmi5LearnerPreferences'});
        try {
            return Boolean(is_good(status) && text && this.on_language?.(JSON.parse(text)?.languagePreference));
        } catch {
            return false;  // no such document
        }
    }
    // False: nothing is kept of it.
    keep_session() { return write_kept(this.browser.session, this.session_key, JSON.stringify(this.session)); }
    async fetch_token() {
        const {status, text} = await this.ask(this.launch.fetch, {method: 'POST'});
        try {
            const answer = JSON.parse(text);
            if (is_good(status) && answer['auth-token']) return answer['auth-token'];
            if (answer['error-code'] || is_good(status)) {
                this.words = 'key_expired';
                this.asks = false;
                console.error(`the platform gives no key: ${answer['error-code']} ${answer['error-text']}`);
                return '';
            }
        } catch {
            // no answer of a platform
        }
        this.words = 'no_answer';
        return '';
    }
    // {status, text}; status 0: no answer, or none in time.
    async ask(address, options) {
        const stop = new AbortController();
        let timer;
        const late = new Promise((done) => {
            timer = setTimeout(() => {
                done({status: 0, text: ''});
                stop.abort();
            }, this.browser.patience_ms ?? kPatienceMs);
        });
        const answered = (async () => {
            try {
                const response = await this.browser.fetch(address, {...options, signal: stop.signal});
                return {status: response.status, text: await response.text()};
            } catch {
                return {status: 0, text: ''};
            }
        })();
        const first = await Promise.race([answered, late]);
        clearTimeout(timer);
        return first;
    }
    address(resource, query) {
        const asked = new URLSearchParams({...query, agent: JSON.stringify(this.actor),
            ...resource === 'activities/state' ? {activityId: this.launch.activityId, registration: this.launch.registration} : {}});
        return `${this.launch.endpoint.replace(/\/$/, '')}/${resource}?${asked}`;
    }
    headers(more = {}) {
        return {Authorization: `Basic ${this.session.token}`, 'X-Experience-API-Version': '1.0.3', ...more};
    }
    read_document(resource, query) { return this.ask(this.address(resource, query), {headers: this.headers(), cache: 'no-store'}); }
    // The platform's template with what a cmi5 statement adds to it.
    context(statement, categories = []) {
        const template = structuredClone(this.session.data.contextTemplate);
        const own = statement.context?.contextActivities?.category ?? [];
        const all = [...template.contextActivities?.category ?? [], ...own, ...categories.map((name) => ({id: `${kCmiContext}categories/${name}`}))];
        const category = [...new Map(all.map((one) => [one.id, one])).values()];
        const out = {...template, registration: this.launch.registration};
        if (category.length) out.contextActivities = {...template.contextActivities, category};
        const mastery = this.session.data.masteryScore;
        if (Number.isFinite(mastery) && [kCmiVerbs.passed, kCmiVerbs.failed].includes(statement.verb.id))
            out.extensions = {...template.extensions, [`${kCmiContext}extensions/masteryscore`]: mastery};
        return out;
    }
    made(verb, id, result) {
        const out = {id: this.browser.id(), actor: this.actor, verb: {id, display: {en: verb}},
            object: {objectType: 'Activity', id: this.launch.activityId}, timestamp: new Date(this.browser.now_ms()).toISOString()};
        return result ? {...out, result} : out;
    }
    defined(verb, result = null) {
        const out = this.made(verb, kCmiVerbs[verb], result);
        const moves_on = result && ('success' in result || 'completion' in result);
        return {...out, context: this.context(out, moves_on ? ['cmi5', 'moveon'] : ['cmi5'])};
    }
    duration() { return words_of_seconds((this.browser.now_ms() - this.session.begun_ms) / 1000); }
    score(part) { return {scaled: part, raw: Math.round(100 * part), min: 0, max: 100}; }

    queue() {
        // Where there was no room, storage has an older list, or none.
        if (this.in_page && !this.keeps_queue) return this.in_page;
        try {
            return JSON.parse(read_kept(this.browser.local, this.queue_key) ?? 'null') ?? [];
        } catch {
            return [];
        }
    }
    set_queue(statements) {
        this.in_page = statements;
        this.keeps_queue = write_kept(this.browser.local, this.queue_key, statements.length ? JSON.stringify(statements) : null);
    }
    queue_statement(statement) { this.set_queue([...this.queue(), statement]); }
    // What is going to be handed over; a launch that is no good hands nothing over.
    waiting() { return this.open || this.asks ? this.queue().length + (this.dirty ? 1 : 0) : 0; }
    // What waits is in this page alone.
    waits_in_page() { return !this.keeps_queue && this.waiting() > 0; }

    save(text, place, part, passed, told) {
        Object.assign(this, {text, part, passed, told, dirty: true});
        this.hand_over();
    }
    // Which of its two statements of a pass a platform has; each goes once for a registration.
    taken() { return (read_kept(this.browser.local, `sonocase-taken ${this.unit}`) ?? '').split(' ').concat(this.session?.taken ?? []); }
    note_taken(verb) {
        this.session.taken = [...this.session.taken ?? [], verb];
        this.keep_session();
        write_kept(this.browser.local, `sonocase-taken ${this.unit}`, [...new Set(this.taken())].filter((one) => one).join(' '));
    }
    // A pass that was refused is told once more in a session, and again in the next.
    may_tell() { return Boolean(this.open && this.judged && this.has_state && !this.ended && (this.session.tries ?? 0) < 2); }
    // Once for a registration; the state's `told` remembers it.
    tell_pass() {
        if (!this.may_tell()) return false;
        this.session.tries = (this.session.tries ?? 0) + 1;
        this.keep_session();
        const taken = [...this.taken(), ...this.queue().map(({verb}) => verb.display?.en)];
        if (!taken.includes('completed')) this.queue_statement(this.defined('completed', {completion: true, duration: this.duration()}));
        if (!taken.includes('passed')) this.queue_statement(this.defined('passed', {success: true, score: this.score(1), duration: this.duration()}));
        this.pass_in_page = !this.keeps_queue;
        return true;
    }
    // statements: of results.js; those that cmi5 allows beside its own. Before the session is open they wait without its
    // context.
    attempted(statements, is_scored) {
        if (!this.unit || this.ended || this.judged === false) return;
        if (is_scored && this.open) {
            this.session.attempts += 1;
            this.keep_session();
        }
        if (is_scored && !this.open) this.early_scored += 1;
        for (const one of statements) {
            const own = {...one, actor: this.actor, object: {...one.object, id: this.launch.activityId}};
            if (!this.open) this.early.add(own.id);
            this.queue_statement(this.open ? {...own, context: this.context(own)} : own);
        }
        this.hand_over();
    }
    // One after the other, oldest first; what does not get through waits.
    hand_over(leaving = false) {
        this.working = (this.working ?? Promise.resolve()).then(async () => {
            if (this.asks && !leaving && !this.ended) await this.connect();
            await this.hand_over_now(leaving);
        }).catch((error) => console.error(error)).then(() => this.on_words?.());
        return this.working;
    }
    async hand_over_now(leaving) {
        if (!this.open) return;
        for (let some; (some = this.queue().slice(0, 20)).length;) {
            let status = await this.send_statements_now(some, leaving), sent = some.length;
            if ((status === 400 || status === 409) && some.length > 1) {
                status = await this.send_statements_now(some.slice(0, 1), leaving);
                sent = 1;
            }
            const refused = status === 400 && sent === 1;
            if (!refused && status !== 409 && !is_good(status)) {
                this.last_status = status;
                return;
            }
            this.set_queue(this.queue().slice(sent));
            for (const {verb} of some.slice(0, sent)) this.was_answered(verb.id, refused);
        }
        this.last_status = 200;
        if (this.pass_in_page) {
            this.pass_in_page = false;
            this.on_handed?.();
        }
        if (!this.dirty || !this.has_state) return;
        const text = this.text;
        const {status} = await this.ask(this.address('activities/state', {stateId: 'sonocase.module'}),
            {method: 'PUT', headers: this.headers({'Content-Type': 'application/json'}), body: text, keepalive: leaving});
        this.last_status = status;
        if (is_good(status) && text === this.text) this.dirty = false;
    }
    was_answered(verb, refused) {
        if (refused) ++this.refused;
        const name = verb === kCmiVerbs.passed ? 'passed' : verb === kCmiVerbs.completed ? 'completed' : '';
        if (!name) return;
        if (!refused) {
            this.note_taken(name);
            if (name === 'passed') this.pass_refused = false;
            return;
        }
        this.pass_refused ||= name === 'passed';
        this.on_refused?.();
    }
    async send_statements_now(statements, leaving) {
        return (await this.ask(`${this.launch.endpoint.replace(/\/$/, '')}/statements`,
            {method: 'POST', headers: this.headers({'Content-Type': 'application/json'}), body: JSON.stringify(statements), keepalive: leaving})).status;
    }
    // Returns where the platform wants its trainee next; "": it does not say.
    async end() {
        if (!this.open) return this.session?.data?.returnURL ?? '';
        if (!this.ended) {
            this.ended = true;
            // Whoever passed and could not tell so has not failed.
            if (this.judged && this.has_state && !this.told && !this.passed && this.session.attempts > 0)
                this.queue_statement(this.defined('failed', {success: false, score: this.score(Math.min(this.part ?? 0, 0.9999)), duration: this.duration()}));
            this.queue_statement(this.defined('terminated', {duration: this.duration()}));
        }
        await this.hand_over(true);
        if (!this.queue().length) this.open = false;
        return this.session.data.returnURL ?? '';
    }
}

// package: of cases.json; store: its record store, or "".
export function platform_of(package_kind, store, browser = this_browser()) {
    if (package_kind === 'cmi5') return new CmiPlatform(browser, store);
    if (package_kind === 'scorm12' || package_kind === 'scorm2004') return new Scorm(package_kind === 'scorm2004', browser);
    return new NoPlatform();
}

// The modules of a course that this page is about, in this browser and on the platform.
export class KeptCourse {
    // names: of the modules; place: what tells sites apart.
    constructor(course, names, trainee_name, platform, browser = this_browser()) {
        Object.assign(this, {course, names, platform, browser, trainee_name, states: new Map(), damaged: false, keeps: true, saved: new Map(), before: new Map(), of_platform: null});
        platform.on_state = (text) => {
            this.take(text);
            this.changed();
        };
        platform.on_handed = () => this.note_handed();
        platform.on_refused = () => {
            for (const module of this.saved.keys()) {
                this.state(module).told = '';
                this.write(module);
            }
        };
        // What was done before this was known goes as well.
        platform.on_unjudged = () => { for (const [name, text] of this.before) write_kept(browser.local, this.key(name), text); };
    }
    key(module) { return `sonocase-course ${this.course} ${this.platform.learner || this.trainee_name} ${module}`; }
    // Known before the platform is asked: only the tab that has it may do so.
    lock_name() {
        const {launch} = this.platform, place = launch?.registration ? `${launch.registration} ${launch.activityId}` : this.browser.page.replace(/[?#].*/, '');
        return `sonocase-course ${place} ${this.course} ${this.names.join()}`;
    }
    // At once with what this browser has; settles once the platform was asked.
    async begin() {
        const asked = this.platform.begin();
        this.read();
        if (!this.begun) {
            this.begun = true;
            this.browser.window.setInterval?.(() => this.hand_over(), kAgainMs);
            this.browser.window.addEventListener?.('online', () => this.hand_over());
        }
        const text = await asked;
        if (text !== undefined) this.take(text);
    }
    // Again when another tab has written.
    read() {
        for (const name of this.names) {
            const text = read_kept(this.browser.local, this.key(name)), here = text && module_state(text);
            this.damaged ||= Boolean(text && !here);
            this.before.set(name, text);
            this.states.set(name, here || new_module_state());
        }
    }
    // text: what the platform keeps; null: nothing.
    take(text) {
        const there = text && module_state(text), {platform, browser} = this;
        this.of_platform = text;
        this.damaged ||= Boolean(text && !there);
        for (const name of this.names) {
            let here = this.states.get(name);
            const other = there?.copy && here.copy && there.copy !== here.copy;
            if (platform.fresh || other) here = never_handed(here);
            const state = merged_states(here, there || null) ?? new_module_state();
            if (platform instanceof Scorm) {
                state.copy = there?.copy || (platform.fresh ? '' : here?.copy) || browser.id().slice(0, 8);
                state.handed = Math.max(here?.handed ?? -1, there ? there.attempts.at(-1)?.started_ms ?? 0 : -1);
            }
            this.states.set(name, state);
        }
    }
    // What follows once the platform's copy has come; a page judges anew instead.
    changed() { for (const [module, what] of this.saved) this.save(module, ...what); }
    state(module) { return this.states.get(module); }
    // part, passed: of the gate. Writes here first, then tells the platform.
    save(module, part, passed, today) {
        const state = this.state(module), {platform} = this;
        state.attempts.sort(by_time);
        this.saved.set(module, [part, passed, today]);
        if (platform.judged === false) return;  // in the page alone: the next session may be judged
        if (passed && !state.told && (!platform.tell_pass || platform.tell_pass())) state.told = today;
        this.write(module);
    }
    write(module) {
        const state = this.state(module), [part, passed] = this.saved.get(module), {platform} = this;
        // A pass that waits in the page alone is lost with it, and is then to be told anew.
        const safe = platform.pass_in_page ? {...state, told: ''} : state;
        this.keep(module, safe);
        platform.save(module_text(safe), `${module}/${state.phase}`, part, passed, state.told);
    }
    keep(module, state) {
        const more = this.platform instanceof Scorm && state.handed !== null ? {h: state.handed} : {};
        this.keeps = write_kept(this.browser.local, this.key(module), module_text(state, more));
    }
    note_handed() {
        for (const module of this.saved.keys()) {
            const state = this.state(module);
            if (!(this.platform instanceof Scorm)) {
                this.write(module);
                continue;
            }
            state.handed = state.attempts.at(-1)?.started_ms ?? 0;
            this.keep(module, state);
        }
    }
    async hand_over() {
        const {platform} = this;
        if (platform.may_tell?.())
            for (const [module, what] of this.saved) if (what[1] && !this.state(module).told) this.save(module, ...what);
        if (platform.waiting() || platform.asks) await platform.hand_over();
    }
    remove() {
        for (const name of this.names) write_kept(this.browser.local, this.key(name), null);
        this.read();
        this.take(this.of_platform);
    }
}
