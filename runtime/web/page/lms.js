// SPDX-License-Identifier: Apache-2.0

// What a trainee has of a course's module, kept in this browser and by the learning platform that opened the page:
// SCORM 1.2 (API), SCORM 2004 (API_1484_11), cmi5, or none. Without a platform the browser alone keeps it. Whatever
// the platform does not take (no network, a session that is over) waits here and is handed over at the next chance,
// also by a later launch. docs/browser.md names the rules that are kept.

import {new_id} from './results.js';

const kMostLetters = 4000;  // of suspend_data: SCORM 1.2 promises 4,096
const kAgainMs = 15000;     // between tries to hand over what waits

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
// in the last attempt, told: the day on which a platform was told of the pass}. As text: attempts as
// milliseconds since the one before, in base 36, and a letter: P F passed or failed, X Y the same in an exam.
const kLetters = ['F', 'P', 'Y', 'X'];
export function new_module_state() { return {phase: 'question', option: -1, attempts: [], value: null, told: ''}; }
export function module_text(state) {
    for (let from = 0;; ++from) {
        let before = 0, packed = '';
        for (const {started_ms, passed, exam} of state.attempts.slice(from)) {
            packed += (started_ms - before).toString(36) + kLetters[(passed ? 1 : 0) + (exam ? 2 : 0)];
            before = started_ms;
        }
        const text = JSON.stringify({v: 2, p: state.phase, o: state.option, a: packed, x: state.value, t: state.told});
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
    if (!unit_ms || typeof kept.a !== 'string' || !/^([0-9a-z]+[FPYX])*$/.test(kept.a)) return null;
    const state = new_module_state();
    if (['question', 'text', 'expert', 'practice'].includes(kept.p)) state.phase = kept.p;
    if (Number.isInteger(kept.o) && kept.o >= 0 && kept.o < 4) state.option = kept.o;
    if (Number.isFinite(kept.x)) state.value = kept.x;
    if (typeof kept.t === 'string') state.told = kept.t;
    let started_ms = 0;
    for (const [, delta, letter] of kept.a.matchAll(/([0-9a-z]+)([FPYX])/g)) {
        started_ms += unit_ms * parseInt(delta, 36);
        const at = kLetters.indexOf(letter);
        state.attempts.push({started_ms, passed: at % 2 === 1, exam: at > 1});
    }
    return state;
}
// Two copies of one trainee's module: nothing of either is lost.
export function merged_states(a, b) {
    if (!a || !b) return a ?? b;
    const kPhases = ['question', 'text', 'expert', 'practice'];
    const all = new Map([...a.attempts, ...b.attempts].map((one) => [one.started_ms, one]));
    const attempts = [...all.values()].sort((x, y) => x.started_ms - y.started_ms);
    const newest = (b.attempts.at(-1)?.started_ms ?? 0) > (a.attempts.at(-1)?.started_ms ?? 0) ? b : a;
    return {phase: kPhases[Math.max(kPhases.indexOf(a.phase), kPhases.indexOf(b.phase))], option: a.option >= 0 ? a.option : b.option,
        attempts, value: newest.value, told: a.told || b.told};
}

// One tab alone writes what is kept under a name. on_mine is called once this tab has it, at once or when the other
// tab lets go; on_other once if another has it.
export function hold_alone(name, on_mine, on_other, browser = this_browser()) {
    const {locks, local, now_ms, window} = browser;
    if (locks) {
        let other_told = false;
        const mine = (lock) => {
            if (lock) {
                on_mine();
                return new Promise(() => {});  // held until the page is gone
            }
            if (!other_told) on_other();
            other_told = true;
            locks.request(name, mine);
            return undefined;
        };
        locks.request(name, {ifAvailable: true}, mine);
        return;
    }
    if (!local) {
        on_mine();
        return;
    }
    // Pages that are not secure have no locks: a lease in storage, renewed while the page lives.
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
        return this.get('cmi.suspend_data') || null;
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
        this.set('cmi.suspend_data', this.text);
        this.set(this.name('place'), this.place);
        if (this.judged) this.tell_standing();
        const seconds = (this.browser.now_ms() - this.begun_ms) / 1000;
        this.set(this.name('time'), this.is_2004 ? words_of_seconds(seconds) : clock_of_seconds(seconds));
        this.dirty = this.call('Commit', '') !== 'true';
    }
    // The score is set once it is a pass: platforms take a lower one for a failed module and close it, though the trainee
    // is only under way. How far that is goes where no status follows from it.
    tell_standing() {
        if (this.is_2004) {
            this.set('cmi.progress_measure', Number(this.part.toFixed(4)));
            if (!this.passed) return;
            for (const [name, value] of [['scaled', 1], ['raw', 100], ['min', 0], ['max', 100]]) this.set(`cmi.score.${name}`, value);
            this.set('cmi.success_status', 'passed');
            this.set('cmi.completion_status', 'completed');
            return;
        }
        if (this.get('cmi.objectives._children')) {
            this.set('cmi.objectives.0.id', 'gate');
            this.set('cmi.objectives.0.score.raw', Math.round(100 * this.part));
            this.set('cmi.objectives.0.status', this.passed ? 'passed' : 'incomplete');
        }
        if (!this.passed) return;
        for (const [name, value] of [['raw', 100], ['min', 0], ['max', 100]]) this.set(`cmi.core.score.${name}`, value);
        this.set('cmi.core.lesson_status', 'passed');
    }
    waiting() { return this.dirty ? 1 : 0; }
    async end() {
        this.leave();
        return '';
    }
    leave() {
        if (!this.open) return;
        this.dirty ||= Boolean(this.text);
        this.hand_over();
        this.open = this.call(this.is_2004 ? 'Terminate' : 'Finish', '') !== 'true';
    }
}

const kCmiContext = 'https://w3id.org/xapi/cmi5/context/';
const kCmiVerbs = {initialized: 'http://adlnet.gov/expapi/verbs/initialized', terminated: 'http://adlnet.gov/expapi/verbs/terminated',
    passed: 'http://adlnet.gov/expapi/verbs/passed', failed: 'http://adlnet.gov/expapi/verbs/failed', completed: 'http://adlnet.gov/expapi/verbs/completed'};
const kOfOneSession = [kCmiVerbs.initialized, kCmiVerbs.terminated, kCmiVerbs.failed];

class CmiPlatform extends NoPlatform {
    // store: the record store that the package was made for; "": the one that the launch names.
    constructor(browser, store) {
        super();
        const asked = new URL(browser.page).searchParams;
        Object.assign(this, {browser, store, dirty: false, refused: 0, launch: Object.fromEntries(
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
        this.queue_key = `sonocase-waiting ${launch.registration} ${launch.activityId}`;
        // The key is given once; a page that is loaded again has it from before.
        this.session_key = `sonocase-cmi5 ${launch.fetch}`;
        try {
            this.session = JSON.parse(read_kept(browser.session, this.session_key) ?? 'null');
        } catch {
            this.session = null;
        }
        if (!this.session) {
            const token = await this.fetch_token();
            if (!token) return null;
            this.session = {token, begun_ms: browser.now_ms(), initialized: false, attempts: 0};
            this.keep_session();
        }
        const data = await this.read_document('activities/state', {stateId: 'LMS.LaunchData'});
        // A page loaded again without a network goes on with what it knew.
        try {
            if (data) this.session.data = JSON.parse(data);
        } catch {
            // said below
        }
        if (!this.session.data?.contextTemplate) {
            this.words = 'no_launch_data';
            return null;
        }
        this.keep_session();
        this.judged = (this.session.data.launchMode ?? 'Normal') === 'Normal';
        await this.read_document('agents/profile', {profileId: 'cmi5LearnerPreferences'});
        this.open = true;
        if (!this.session.initialized) {
            const left = this.queue();
            this.set_queue([]);
            this.queue_statement(this.defined('initialized'));
            this.session.initialized = true;
            this.keep_session();
            // Statements of a session that broke off go with this one.
            for (const statement of left) {
                if (!kOfOneSession.includes(statement.verb.id)) this.queue_statement({...statement, context: this.context(statement)});
            }
        }
        const kept = await this.read_document('activities/state', {stateId: 'sonocase.module'});
        await this.hand_over();
        return kept;
    }
    keep_session() { write_kept(this.browser.session, this.session_key, JSON.stringify(this.session)); }
    async fetch_token() {
        try {
            const response = await this.browser.fetch(this.launch.fetch, {method: 'POST'});
            const answer = await response.json();
            if (answer['auth-token']) return answer['auth-token'];
            this.words = 'key_expired';
            console.error(`the platform gives no key: ${answer['error-code']} ${answer['error-text']}`);
        } catch {
            this.words = 'no_answer';
        }
        return '';
    }
    address(resource, query) {
        const asked = new URLSearchParams({...query, agent: JSON.stringify(this.actor),
            ...resource === 'activities/state' ? {activityId: this.launch.activityId, registration: this.launch.registration} : {}});
        return `${this.launch.endpoint.replace(/\/$/, '')}/${resource}?${asked}`;
    }
    headers(more = {}) {
        return {Authorization: `Basic ${this.session.token}`, 'X-Experience-API-Version': '1.0.3', ...more};
    }
    // Null: there is none, or no answer.
    async read_document(resource, query) {
        try {
            const response = await this.browser.fetch(this.address(resource, query), {headers: this.headers(), cache: 'no-store'});
            return response.ok ? await response.text() : null;
        } catch {
            return null;
        }
    }
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
        try {
            return JSON.parse(read_kept(this.browser.local, this.queue_key) ?? 'null') ?? this.in_page ?? [];
        } catch {
            return this.in_page ?? [];
        }
    }
    set_queue(statements) {
        this.in_page = statements;
        write_kept(this.browser.local, this.queue_key, statements.length ? JSON.stringify(statements) : null);
    }
    queue_statement(statement) { this.set_queue([...this.queue(), statement]); }
    waiting() { return this.open ? this.queue().length + (this.dirty ? 1 : 0) : 0; }

    save(text, place, part, passed, told) {
        Object.assign(this, {text, part, passed, told, dirty: true});
        this.hand_over();
    }
    // Once for a registration; the state's `told` remembers it.
    tell_pass() {
        if (!this.open || !this.judged) return false;
        this.queue_statement(this.defined('completed', {completion: true, duration: this.duration()}));
        this.queue_statement(this.defined('passed', {success: true, score: this.score(1), duration: this.duration()}));
        return true;
    }
    // statements: of results.js; those that cmi5 allows beside its own.
    attempted(statements, is_scored) {
        if (!this.open) return;
        if (is_scored) {
            this.session.attempts += 1;
            this.keep_session();
        }
        for (const one of statements) {
            const own = {...one, actor: this.actor, object: {...one.object, id: this.launch.activityId}};
            this.queue_statement({...own, context: this.context(own)});
        }
        this.hand_over();
    }
    // One after the other, oldest first; what does not get through waits.
    hand_over(leaving = false) {
        this.working = (this.working ?? Promise.resolve()).then(() => this.hand_over_now(leaving)).catch((error) => console.error(error));
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
            if (status === 400 && sent === 1) ++this.refused;
            else if (status !== 409 && (status < 200 || status > 299)) {
                this.last_status = status;
                return;
            }
            this.set_queue(this.queue().slice(sent));
        }
        this.last_status = 200;
        if (!this.dirty) return;
        const text = this.text;
        try {
            const response = await this.browser.fetch(this.address('activities/state', {stateId: 'sonocase.module'}),
                {method: 'PUT', headers: this.headers({'Content-Type': 'application/json'}), body: text, keepalive: leaving});
            this.last_status = response.status;
            if (response.ok && text === this.text) this.dirty = false;
        } catch {
            this.last_status = 0;
        }
    }
    async send_statements_now(statements, leaving) {
        try {
            const response = await this.browser.fetch(`${this.launch.endpoint.replace(/\/$/, '')}/statements`,
                {method: 'POST', headers: this.headers({'Content-Type': 'application/json'}), body: JSON.stringify(statements), keepalive: leaving});
            return response.status;
        } catch {
            return 0;
        }
    }
    // Returns where the platform wants its trainee next; "": it does not say.
    async end() {
        if (!this.open) return this.session?.data?.returnURL ?? '';
        if (this.judged && !this.told && this.session.attempts > 0)
            this.queue_statement(this.defined('failed', {success: false, score: this.score(Math.min(this.part ?? 0, 0.9999)), duration: this.duration()}));
        this.queue_statement(this.defined('terminated', {duration: this.duration()}));
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
        Object.assign(this, {course, names, platform, browser, trainee_name, states: new Map(), damaged: false, keeps: true});
    }
    key(module) { return `sonocase-course ${this.course} ${this.platform.learner || this.trainee_name} ${module}`; }
    // Known before the platform is asked: only the tab that has it may do so.
    lock_name() {
        const {launch} = this.platform, place = launch?.registration ? `${launch.registration} ${launch.activityId}` : this.browser.page.replace(/[?#].*/, '');
        return `sonocase-course ${place} ${this.course} ${this.names.join()}`;
    }
    async begin() {
        this.of_platform = await this.platform.begin();
        this.read();
        if (this.begun) return;
        this.begun = true;
        this.browser.window.setInterval?.(() => this.hand_over(), kAgainMs);
        this.browser.window.addEventListener?.('online', () => this.hand_over());
    }
    // Again when another tab has written.
    read() {
        for (const name of this.names) {
            const text = read_kept(this.browser.local, this.key(name));
            const here = text && module_state(text), there = this.of_platform && module_state(this.of_platform);
            this.damaged ||= Boolean(text && !here) || Boolean(this.of_platform && !there);
            this.states.set(name, merged_states(here || null, there || null) ?? new_module_state());
        }
    }
    state(module) { return this.states.get(module); }
    // part, passed: of the gate. Writes here first, then tells the platform.
    save(module, part, passed, today) {
        const state = this.state(module);
        if (passed && !state.told && (!this.platform.tell_pass || this.platform.tell_pass())) state.told = today;
        const text = module_text(state);
        this.keeps = write_kept(this.browser.local, this.key(module), text);
        this.platform.save(text, `${module}/${state.phase}`, part, passed, state.told);
    }
    hand_over() { return this.platform.waiting() ? this.platform.hand_over() : Promise.resolve(); }
    remove() {
        for (const name of this.names) write_kept(this.browser.local, this.key(name), null);
        this.read();
    }
}
