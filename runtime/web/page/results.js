// SPDX-License-Identifier: Apache-2.0

// Attempts that are kept in this browser, and statements to a learning record store.

const kDatabase = 'sonocase', kStore = 'attempts';

function request(work) {
    return new Promise((done, failed) => {
        work.onsuccess = () => done(work.result);
        work.onerror = () => failed(work.error);
    });
}

// null: this browser keeps nothing here.
let database;
async function open_database() {
    if (database !== undefined) return database;
    try {
        const opening = indexedDB.open(kDatabase, 1);
        opening.onupgradeneeded = () => opening.result.createObjectStore(kStore, {keyPath: 'id', autoIncrement: true});
        database = await request(opening);
    } catch {
        database = null;
    }
    return database;
}

async function store(mode) {
    const open = await open_database();
    return open && open.transaction(kStore, mode).objectStore(kStore);
}

// attempt: {started, trainee, case_name, exercise, title, passed, recording, score_text}.
// false: nothing was kept.
export async function keep_attempt(attempt) {
    try {
        const to = await store('readwrite');
        if (to) await request(to.add(attempt));
        return Boolean(to);
    } catch {
        return false;
    }
}
export async function kept_attempts() {
    const from = await store('readonly');
    return from ? request(from.getAll()) : null;
}
export async function remove_attempts() {
    const from = await store('readwrite');
    if (from) await request(from.clear());
}

export function trainee() {
    try {
        return localStorage.getItem('trainee') ?? '';
    } catch {
        return '';
    }
}
export function set_trainee(name) {
    try {
        localStorage.setItem('trainee', name);
    } catch {
        // No storage: the name holds for this visit alone, in the field itself.
    }
}

export function download(name, type, content) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([content], {type}));
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
}

// "20260131T120000Z_case_exercise", as the desktop names recordings.
export function file_name(attempt) {
    const stamp = attempt.started.replaceAll(/[:-]/g, '');
    return `${stamp}_${attempt.case_name}_${attempt.exercise}`.replaceAll(/[^0-9A-Za-z_-]/g, '-');
}

const kVerb = {
    attempted: 'http://adlnet.gov/expapi/verbs/attempted',
    completed: 'http://adlnet.gov/expapi/verbs/completed',
    scored: 'http://adlnet.gov/expapi/verbs/scored',
};

// What a learning platform's xAPI launch puts into the page's address: endpoint, auth, actor,
// registration, activity_id. published: the endpoint that this site was published with; a launch may
// name another path and key, but no other host. Null: no launch.
export function launch_of(search, published) {
    const asked = new URLSearchParams(search);
    const endpoint = asked.get('endpoint');
    if (!endpoint || !published) return null;
    let actor = null;
    try {
        if (new URL(endpoint).origin !== new URL(published, location.href).origin) return null;
        actor = JSON.parse(asked.get('actor') ?? 'null');
    } catch {
        return null;
    }
    if (actor && typeof actor === 'object') {
        // Platforms of before 1.0 write lists.
        for (const [key, value] of Object.entries(actor)) if (Array.isArray(value)) [actor[key]] = value;
        actor.objectType ??= 'Agent';
    }
    return {endpoint, actor, auth: asked.get('auth') ?? '', registration: asked.get('registration') ?? '',
        activity: asked.get('activity_id') ?? ''};
}

const seconds_since = (started) => Math.max(0, (Date.now() - Date.parse(started)) / 1000);

// An xAPI 1.0.3 statement. verb: of kVerb. score: of score_json, or null. launch: of launch_of.
export function statement(verb, attempt, score, launch = null) {
    const site = location.href.replace(/[?#].*/, '');
    const out = {
        id: crypto.randomUUID?.(),
        actor: launch?.actor ?? {objectType: 'Agent', account: {homePage: site, name: attempt.trainee || 'nobody'}},
        verb: {id: kVerb[verb], display: {en: verb}},
        object: {
            objectType: 'Activity',
            id: launch?.activity || `${site}?case=${encodeURIComponent(attempt.case_name)}&exercise=${encodeURIComponent(attempt.exercise)}`,
            definition: {name: {en: attempt.title}, type: 'http://adlnet.gov/expapi/activities/simulation'},
        },
        timestamp: score ? new Date().toISOString() : attempt.started,
    };
    if (launch?.registration) out.context = {registration: launch.registration};
    if (score) {
        const extensions = {};
        for (const [name, value] of Object.entries(score.metrics)) extensions[`${site}#${name}`] = value;
        out.result = {success: score.passed, completion: true, extensions};
        const taken_s = seconds_since(attempt.started);
        if (Number.isFinite(taken_s)) out.result.duration = `PT${taken_s.toFixed(2)}S`;
        const marks = score.pass_marks;
        if (verb === 'scored' && marks.length)
            out.result.score = {scaled: marks.filter((mark) => mark.passed).length / marks.length};
    }
    return out;
}

// endpoint: the store's address, "" for none. auth: the Authorization that the launch gave; "": none.
// Returns true if the store took them all.
export async function send_statements(endpoint, statements, auth = '') {
    if (!endpoint) return true;
    try {
        const response = await fetch(`${endpoint.replace(/\/$/, '')}/statements`, {
            method: 'POST',
            credentials: 'same-origin',  // stores that answer any origin take no cookies
            headers: {'Content-Type': 'application/json', 'X-Experience-API-Version': '1.0.3',
                ...auth ? {Authorization: auth} : {}},
            body: JSON.stringify(statements),
        });
        return response.ok;
    } catch {
        return false;
    }
}

export function minutes(seconds) {
    const whole = Math.floor(seconds);
    return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
}
