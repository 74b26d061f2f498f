// SPDX-License-Identifier: Apache-2.0

// Attempts that are kept in this browser, and statements to a learning record store.

import {t} from './words.js';

const kDatabase = 'sonocase', kStore = 'attempts', kRecordings = 'recordings', kWaiting = 'statements';
const kLongestOpeningMs = 5000;

function request(work) {
    return new Promise((done, failed) => {
        work.onsuccess = () => done(work.result);
        work.onerror = () => failed(work.error);
    });
}
// A transaction keeps what was asked of it once it is complete, not before: where the browser is full, its requests
// succeed and it is aborted.
function complete(transaction) {
    return new Promise((done, failed) => {
        transaction.oncomplete = () => done();
        transaction.onabort = transaction.onerror = () => failed(transaction.error ?? new Error('not kept'));
    });
}

let opening;  // promise of the database; null: this browser keeps nothing here
let waits_for_tab = false, on_late = () => {};
// Another tab of this site has an older page open, and the store waits until it is closed.
export const store_waits = () => waits_for_tab;
// what(): called when the store was opened after all, once that tab is closed.
export function when_store_opens(what) { on_late = what; }

function open_database() {
    opening ??= new Promise((done) => {
        let late = false, timer = 0, again = 5;
        const give_up = () => {
            late = true;
            done(null);
        };
        const ask = (version) => {
            const asked = indexedDB.open(kDatabase, version);
            asked.onupgradeneeded = () => {
                const db = asked.result;
                if (!db.objectStoreNames.contains(kStore)) db.createObjectStore(kStore, {keyPath: 'id', autoIncrement: true});
                if (!db.objectStoreNames.contains(kWaiting)) db.createObjectStore(kWaiting, {keyPath: 'key', autoIncrement: true});
                // Recordings have megabytes: apart from what lists and standings are made of.
                if (!db.objectStoreNames.contains(kRecordings)) db.createObjectStore(kRecordings, {keyPath: 'id'});
            };
            asked.onblocked = () => {
                waits_for_tab = true;
                give_up();
            };
            asked.onerror = () => {
                // A newer page was here: what it has is opened as it is.
                if (asked.error?.name === 'VersionError' && version) ask(undefined);
                else if (again-- > 0) setTimeout(ask, 200, version);  // site data is just being cleared, perhaps
                else give_up();
            };
            asked.onsuccess = () => {
                clearTimeout(timer);
                const db = asked.result;
                const closed = () => { opening = undefined; };
                db.onclose = closed;  // the browser cleared the site's data
                db.onversionchange = () => {  // a newer page of this site, in another tab
                    db.close();
                    closed();
                };
                done(db);
                if (!late) return;
                opening = Promise.resolve(db);
                waits_for_tab = false;
                keep_what_waited().finally(() => on_late());
            };
        };
        try {
            ask(3);
            timer = setTimeout(give_up, kLongestOpeningMs);
        } catch {
            give_up();
        }
    });
    return opening;
}

// null: this browser keeps nothing here.
async function transaction_on(names, mode) {
    const db = await open_database();
    if (!db) return null;
    try {
        return db.transaction(names, mode);
    } catch (error) {
        // Closed in the meantime: once more, with what is there now.
        if (error.name !== 'InvalidStateError') throw error;
        opening = undefined;
        const again = await open_database();
        return again && again.transaction(names, mode);
    }
}
async function store(mode, name = kStore) {
    const transaction = await transaction_on(name, mode);
    return transaction && transaction.objectStore(name);
}
// Of one store, in a transaction of its own; false: nothing is kept here.
async function change(name, work) {
    const to = await store('readwrite', name);
    if (!to) return false;
    const kept = complete(to.transaction), answer = request(work(to));
    answer.catch(() => {});  // the transaction says it too
    await kept;
    return answer;
}

// Attempts that could not be kept: for as long as this page is open.
let in_this_page = [];

async function put_attempt({recording, ...rest}) {
    const transaction = await transaction_on([kStore, kRecordings], 'readwrite');
    if (!transaction) return false;
    const kept = complete(transaction);
    const adding = transaction.objectStore(kStore).add(rest);
    adding.onsuccess = () => transaction.objectStore(kRecordings).put({id: adding.result, recording});
    await kept;
    return true;
}
// attempt: {started, started_ms, trainee, case_name, exercise, title, passed, recording, score_text}.
// false: it was not kept, and stays in this page alone.
export async function keep_attempt(attempt) {
    const kept = await put_attempt(attempt).catch(() => false);
    if (!kept) in_this_page.push(attempt);
    return kept;
}
async function keep_what_waited() {
    const waited = in_this_page;
    in_this_page = [];
    for (const attempt of waited) await keep_attempt(attempt);
}

// A record as lists and standings read it, of this version of the page or an older one; one that cannot be read has
// `damaged` and its id alone.
function readable(id, record) {
    try {
        const {recording, ...one} = record, score = JSON.parse(one.score_text), started_ms = Date.parse(one.started);
        if ([one.case_name, one.exercise, one.started].every((part) => typeof part === 'string') && Number.isFinite(started_ms) && score && typeof score === 'object')
            return {trainee: '', started_ms, title: one.exercise, ...one, id, metrics: score.metrics ?? {}};
    } catch {
        // As one that lacks something.
    }
    return {id, damaged: true};
}
// Oldest first, without recordings. null: this browser keeps nothing, and neither does the page.
export async function kept_attempts() {
    // Once more: the browser cleared the site's data while they were read, perhaps.
    return read_attempts().catch(() => { opening = undefined; return read_attempts(); });
}
async function read_attempts() {
    const here = in_this_page.map((one) => ({...readable(undefined, one), in_page: one}));
    const from = await store('readonly');
    if (!from) return here.length ? here : null;
    const ids = await request(from.getAllKeys()), to_move = [];
    const kept = await Promise.all(ids.map((id) => new Promise((done, failed) => {
        const asked = from.get(id);
        asked.onsuccess = () => {
            const one = readable(id, asked.result);
            if (asked.result?.recording && !one.damaged) to_move.push(id);
            done(one);
        };
        asked.onerror = (event) => {
            if (asked.error?.name === 'AbortError') return failed(asked.error);
            event?.preventDefault();  // the others are read all the same
            done({id, damaged: true});
        };
    })));
    move_recordings(to_move).catch(() => {});  // they are read where they are
    return [...kept, ...here];
}
// Older pages kept recordings within attempts. One by one, so that a full browser holds up none.
let moving = Promise.resolve();
function move_recordings(ids) {
    moving = moving.catch(() => {}).then(async () => {
        for (const id of ids) {
            const transaction = await transaction_on([kStore, kRecordings], 'readwrite');
            if (!transaction) return;
            const done = complete(transaction), asked = transaction.objectStore(kStore).get(id);
            asked.onsuccess = () => {
                if (!asked.result?.recording) return;
                const {recording, ...rest} = asked.result;
                transaction.objectStore(kRecordings).put({id, recording});
                transaction.objectStore(kStore).put(rest);
            };
            await done;
        }
    });
    return moving;
}
// The bytes of an attempt of kept_attempts(); null: they are not there, or cannot be read.
export async function recording_of({id, in_page}) {
    if (in_page) return in_page.recording;
    try {
        const transaction = await transaction_on([kStore, kRecordings], 'readonly');  // one: it may be put apart just now
        const within = request(transaction.objectStore(kStore).get(id)), apart = request(transaction.objectStore(kRecordings).get(id));
        within.catch(() => {});
        return (await apart)?.recording ?? (await within)?.recording ?? null;
    } catch {
        return null;
    }
}
export async function remove_attempt(id) {
    await change(kStore, (from) => from.delete(id));
    await change(kRecordings, (from) => from.delete(id));
}
export async function remove_attempts() {
    in_this_page = [];
    await change(kStore, (from) => from.clear());
    await change(kRecordings, (from) => from.clear());
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

// A UUID of version 4, also in pages that are not secure, where crypto.randomUUID is missing.
export function new_id() {
    if (crypto.randomUUID) return crypto.randomUUID();
    const b = crypto.getRandomValues(new Uint8Array(16));
    b[6] = (b[6] & 0x0f) | 0x40;
    b[8] = (b[8] & 0x3f) | 0x80;
    const hex = [...b].map((byte) => byte.toString(16).padStart(2, '0')).join('');
    return hex.replace(/^(.{8})(.{4})(.{4})(.{4})/, '$1-$2-$3-$4-');
}

const seconds_since = (started) => Math.max(0, (Date.now() - Date.parse(started)) / 1000);

// An xAPI 1.0.3 statement. verb: of kVerb. score: of score_json, or null. launch: of launch_of.
export function statement(verb, attempt, score, launch = null) {
    const site = location.href.replace(/[?#].*/, '');
    const out = {
        id: new_id(),
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
        const marks = score.pass_marks, list = score.procedure;
        // The list of a procedure: what was ticked, with the second of it.
        if (list) {
            extensions[`${site}#checklist`] = list.items.map(({name, ticked, critical, time_s, why}) => ({name, ticked, critical, time_s, ...why ? {why} : {}}));
            extensions[`${site}#complications`] = list.complications;
        }
        if (verb === 'scored' && list)
            out.result.score = {raw: list.points, min: 0, max: list.max_points, scaled: list.max_points > 0 ? list.points / list.max_points : 0};
        else if (verb === 'scored' && marks.length)
            out.result.score = {scaled: marks.filter((mark) => mark.passed).length / marks.length};
    }
    return out;
}

// Statements on their way: kept in this browser until the store has them, so that neither a store
// that does not answer nor a page that is closed loses one. Without storage they wait in the page.
let in_page = [], next_key = -1;
async function wait_for_store(endpoint, statement) {
    try {
        const key = await change(kWaiting, (to) => to.add({endpoint, statement}));
        if (key !== false) return key;
    } catch {
        // No room: in the page.
    }
    in_page.push({key: next_key, endpoint, statement});
    return next_key--;
}
async function waiting_for(endpoint) {
    let kept = [];
    try {
        const from = await store('readonly', kWaiting);
        if (from) kept = await request(from.getAll());
    } catch {
        // What waits in the page is sent all the same.
    }
    return [...kept, ...in_page].filter((one) => one.endpoint === endpoint);
}
async function no_longer_waits(one) {
    in_page = in_page.filter(({key}) => key !== one.key);
    try {
        if (one.key > 0) await change(kWaiting, (from) => from.delete(one.key));
    } catch {
        // It is sent again; the store knows its id.
    }
}

// The store's status; 0: no answer.
async function post(endpoint, statements, auth) {
    const body = JSON.stringify(statements);
    try {
        const response = await fetch(`${endpoint.replace(/\/$/, '')}/statements`, {
            method: 'POST',
            credentials: 'same-origin',  // stores that answer any origin take no cookies
            headers: {'Content-Type': 'application/json', 'X-Experience-API-Version': '1.0.3',
                ...auth ? {Authorization: auth} : {}},
            body,
            keepalive: body.length < 60000,  // also while the page is being left
            ...AbortSignal.timeout ? {signal: AbortSignal.timeout(20000)} : {},
        });
        return response.status;
    } catch {
        return 0;
    }
}

let sending = Promise.resolve();
// Sends these and all that wait for this store, oldest first. endpoint: the store's address, "" for
// none. auth: the Authorization that the launch or the site gave; "": none. It is not kept.
// {waiting: how many wait still, refused: how many the store will not have, status: its last}.
export function send_statements(endpoint, statements, auth = '') {
    if (!endpoint) return Promise.resolve({waiting: 0, refused: 0, status: 200});
    // One after the other: none is sent twice because two calls saw it waiting.
    sending = sending.then(async () => {
        for (const one of statements) await wait_for_store(endpoint, one);
        let refused = 0, status = 200;
        const taken = (code) => code >= 200 && code < 300 || code === 409;  // 409: it has that id
        for (let all = await waiting_for(endpoint); all.length; all = all.slice(50)) {
            const some = all.slice(0, 50);
            status = await post(endpoint, some.map(({statement}) => statement), auth);
            if (status >= 200 && status < 300) {
                for (const one of some) await no_longer_waits(one);
                continue;
            }
            // Of a store that is away, or wants another key, nothing is known of the statements.
            if (status !== 400 && status !== 409 && status !== 413) break;
            for (const one of some) {
                status = await post(endpoint, [one.statement], auth);
                if (!taken(status) && status !== 400) break;
                if (status === 400) ++refused;
                await no_longer_waits(one);
            }
            if (!taken(status) && status !== 400) break;
        }
        return {waiting: (await waiting_for(endpoint)).length, refused, status};
    }).catch(() => ({waiting: statements.length, refused: 0, status: 0}));
    return sending;
}

// What is said where a store did not take all; "": it did.
export function words_of_sending({waiting, refused, status}) {
    if (refused) return t('The learning record store refuses %d results: save the scores and hand them in.', refused);
    if (!waiting) return '';
    const why = status === 401 || status === 403 ? t('The learning record store wants another key: open the page from the learning platform again.')
        : status === 0 ? t('The learning record store does not answer, or does not allow this page (CORS).') : t('The learning record store answers %d.', status);
    return `${why} ${t('%d results wait in this browser and are sent again; save the scores to be sure.', waiting)}`;
}

export function minutes(seconds) {
    const whole = Math.floor(seconds);
    return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
}
