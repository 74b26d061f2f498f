// SPDX-License-Identifier: Apache-2.0

// Attempts that a browser keeps, and statements to a learning record store (runtime/web/page/results.js), in node: with a
// browser that keeps things or does not, and with a store that answers as those of learning platforms do, or does not.
import {createServer} from 'node:http';
import {webcrypto} from 'node:crypto';
import {expect, expect_equal, run_tests} from './support.mjs';

globalThis.crypto ??= webcrypto;
globalThis.location = {href: 'https://site.example.org/ward/index.html?case=demo'};
let pages = 0;
// The module anew, as a page that opens.
const open_page = () => import(`../../../runtime/web/page/results.js?${++pages}`);

// As much of IndexedDB as results.js uses; what it holds stays when a page opens anew. As in a browser, what a transaction
// was asked for stays once it is complete. full(): the browser has no room: requests succeed, and the transaction is aborted.
// blocked: an older page is open in another tab, until free() is called. version: of the newest page that was here. Once
// `clears` is set, the next request meets the browser clearing the site's data, and the next three openings fail.
function kept_storage({full = () => false, blocked = false, version = 0} = {}) {
    const stores = new Map(), storage = {stores, opened: 0};
    const later = (what) => setTimeout(what, 0);
    const make = (name, {keyPath}) => stores.set(name, {keyPath, next: 1, rows: new Map()});
    const transaction = (db, names) => {
        if (db.closed) throw new DOMException('closed', 'InvalidStateError');
        const on = {error: null}, undo = new Map();
        let waiting = 0;
        const settle = () => later(() => {
            if (waiting || on.ended) return;
            on.ended = true;
            if (undo.size && full()) {
                for (const [of, rows] of undo) of.rows = rows;
                on.error = new DOMException('full', 'QuotaExceededError');
                on.onabort?.();
            } else {
                on.oncomplete?.();
            }
        });
        const answer = (work) => {
            const asked = {};
            ++waiting;
            later(() => {
                --waiting;
                try {
                    if (storage.clears) {
                        storage.clears = false;
                        storage.refuses = 3;
                        db.closed = true;
                        for (const of of stores.values()) of.rows.clear();
                        throw new DOMException('cleared', 'AbortError');
                    }
                    asked.result = work();
                    asked.onsuccess?.();
                } catch (error) {
                    asked.error = error;
                    asked.onerror?.({preventDefault() {}});
                }
                settle();
            });
            return asked;
        };
        on.objectStore = (name) => {
            if (![names].flat().includes(name)) throw new DOMException(name, 'NotFoundError');
            const of = stores.get(name);
            const writes = (work) => answer(() => { if (!undo.has(of)) undo.set(of, new Map(of.rows)); return work(); });
            const put = (row) => { const key = row[of.keyPath] ?? of.next++; of.rows.set(key, {...structuredClone(row), [of.keyPath]: key}); return key; };
            return {
                transaction: on,
                add: (row) => writes(() => put(row)), put: (row) => writes(() => put(row)),
                delete: (key) => writes(() => of.rows.delete(key)), clear: () => writes(() => of.rows.clear()),
                get: (key) => answer(() => { if (of.rows.get(key) === 'unreadable') throw new DOMException('lost', 'DataError'); return of.rows.get(key); }),
                getAll: () => answer(() => [...of.rows.values()]), getAllKeys: () => answer(() => [...of.rows.keys()]),
            };
        };
        return on;
    };
    storage.make = make;
    storage.open = (name, asked_version) => {
        const opening = {};
        const succeed = () => {
            const db = {closed: false, close: () => { db.closed = true; }, objectStoreNames: {contains: (one) => stores.has(one)}, createObjectStore: make,
                transaction: (names) => transaction(db, names)};
            storage.db = opening.result = db;
            ++storage.opened;
            if (!asked_version || asked_version <= version) return later(() => opening.onsuccess?.());
            version = asked_version;
            opening.onupgradeneeded?.();
            return later(() => opening.onsuccess?.());
        };
        later(() => {
            if (storage.refuses > 0) {
                --storage.refuses;
                opening.error = new DOMException('being cleared', 'UnknownError');
                opening.onerror?.();
            } else if (asked_version < version) {
                opening.error = new DOMException('newer', 'VersionError');
                opening.onerror?.();
            } else if (blocked) {
                storage.free = succeed;
                opening.onblocked?.();
            } else {
                succeed();
            }
        });
        return opening;
    };
    return storage;
}

// answer(statements, request): the status that the store gives.
async function with_store(answer, use) {
    const store = {has: new Map(), requests: []};
    const server = createServer((request, response) => {
        let text = '';
        request.on('data', (data) => { text += data; });
        request.on('end', () => {
            const statements = JSON.parse(text);
            store.requests.push({url: request.url, headers: request.headers, count: statements.length});
            const status = answer(statements, request);
            if (status === 0) { request.socket.destroy(); return; }
            if (status < 300) for (const one of statements) store.has.set(one.id, one);
            response.writeHead(status).end('[]');
        });
    });
    await new Promise((done) => server.listen(0, '127.0.0.1', done));
    try {
        await use(store, `http://127.0.0.1:${server.address().port}/xapi`);
    } finally {
        server.closeAllConnections?.();
        server.close();
    }
}

const attempt = {started: '2026-01-31T12:00:00Z', trainee: 'Ada', case_name: 'demo', exercise: 'liver', title: 'Liver'};
const attempt_of = (n) => ({...attempt, started_ms: n, passed: false, seed: 0, exam: false, score_text: '{"metrics":{"elapsed_time_s":9}}', recording: new Uint8Array([n])});
const score = {passed: true, metrics: {targets_hit: 1}, pass_marks: [{passed: true}, {passed: false}]};
const three = (page, launch = null) => [page.statement('attempted', attempt, null, launch),
    page.statement('completed', attempt, score, launch), page.statement('scored', attempt, score, launch)];

await run_tests({
    async a_store_that_is_there_takes_all_at_once_and_nothing_waits() {
        globalThis.indexedDB = kept_storage();
        const page = await open_page();
        await with_store(() => 200, async (store, endpoint) => {
            const sent = await page.send_statements(`${endpoint}/`, three(page), 'Basic a2V5OnNlY3JldA==');
            expect_equal(page.words_of_sending(sent), '', 'nothing to say');
            expect_equal(store.requests.length, 1, 'requests');
            const {url, headers} = store.requests[0];
            expect_equal(url, '/xapi/statements', 'url');
            expect_equal(headers.authorization, 'Basic a2V5OnNlY3JldA==', 'key');
            expect_equal(headers['x-experience-api-version'], '1.0.3', 'version');
            expect_equal(headers.cookie, undefined, 'no cookies');
            expect_equal((await page.send_statements(endpoint, [], '')).waiting, 0, 'waiting');
            expect_equal(store.requests.length, 1, 'nothing is sent twice');
        });
    },
    async what_is_not_taken_waits_over_visits_and_is_sent_once() {
        for (const storage of [true, false]) {
            globalThis.indexedDB = storage ? kept_storage() : undefined;
            let up = 0;
            await with_store(() => [0, 503, 401, 200][up], async (store, endpoint) => {
                let page = await open_page();
                const ids = [];
                for (up = 0; up < 3; ++up) {
                    const statements = three(page);
                    ids.push(...statements.map(({id}) => id));
                    const sent = await page.send_statements(endpoint, statements);
                    expect_equal(sent.waiting, 3 * (up + 1), 'waiting');
                    expect(page.words_of_sending(sent).includes(['does not answer', '503', 'another key'][up]), page.words_of_sending(sent));
                    if (storage) page = await open_page();
                }
                expect_equal((await page.send_statements('http://127.0.0.1:9/other', [])).waiting, 0, 'of another store');
                const sent = await Promise.all([page.send_statements(endpoint, []), page.send_statements(endpoint, [])]);
                expect_equal(sent[1].waiting, 0, 'all are there');
                expect_equal([...store.has.keys()].join(), ids.join(), 'in their order');
                expect_equal(store.requests.map(({count}) => count).join(), '3,6,9,9', 'each try once');
            });
        }
    },
    async an_attempt_is_kept_once_the_transaction_is_complete() {
        let full = false;
        globalThis.indexedDB = kept_storage({full: () => full});
        let page = await open_page();
        expect_equal(await page.keep_attempt(attempt_of(1)), true, 'kept');
        full = true;
        expect_equal(await page.keep_attempt(attempt_of(2)), false, 'no room');
        const said = (all) => all.map(({started_ms, in_page}) => `${started_ms}${in_page ? ' here' : ''}`).join();
        const all = await page.kept_attempts();
        expect_equal(said(all), '1,2 here', 'both are in this page');
        expect_equal([...await page.recording_of(all[0]), ...await page.recording_of(all[1])].join(), '1,2', 'recordings');
        expect_equal(globalThis.indexedDB.stores.get('recordings').rows.size, 1, 'no half of an attempt');
        // Statements wait in the page where there is no room.
        await with_store(() => 503, async (store, endpoint) => {
            expect_equal((await page.send_statements(endpoint, three(page))).waiting, 3, 'waiting');
        });
        let failed = false;
        await page.remove_attempts().catch(() => { failed = true; });
        expect(failed, 'a removal that did not happen is said');
        page = await open_page();
        expect_equal(said(await page.kept_attempts()), '1', 'the next visit has the one that was kept');
    },
    async attempts_of_older_pages_are_read_and_their_recordings_put_apart() {
        const storage = globalThis.indexedDB = kept_storage({version: 2});
        storage.make('attempts', {keyPath: 'id'});
        storage.make('statements', {keyPath: 'key'});
        const {rows} = storage.stores.get('attempts');
        const {started_ms, seed, exam, trainee, ...oldest} = attempt_of(1);
        rows.set(7, {...oldest, id: 7}).set(8, {...attempt_of(8), id: 8});
        const page = await open_page(), all = await page.kept_attempts();
        expect_equal(all.map((one) => `${one.id} ${one.trainee} ${one.started_ms} ${one.recording}`).join(), `7  ${Date.parse(oldest.started)} undefined,8 Ada 8 undefined`, 'read');
        expect_equal([...await page.recording_of(all[0])].join(), '1', 'its recording');
        for (let n = 0; n < 100 && storage.stores.get('recordings').rows.size < 2; ++n) await new Promise((done) => setTimeout(done, 5));
        expect_equal([...storage.stores.get('attempts').rows.values()].map((one) => one.recording).join(), ',', 'none is left within');
        expect_equal([...await page.recording_of(all[1])].join(), '8', 'its recording, apart');
        await page.remove_attempt(7);
        expect_equal(`${[...storage.stores.get('attempts').rows.keys()]} ${[...storage.stores.get('recordings').rows.keys()]}`, '8 8', 'one is removed');
    },
    async a_damaged_record_holds_up_none_of_the_others() {
        const storage = globalThis.indexedDB = kept_storage(), page = await open_page();
        await page.keep_attempt(attempt_of(1));
        const {rows} = storage.stores.get('attempts'), {score_text, started, ...rest} = attempt_of(2);
        rows.set(2, {...rest, started}).set(3, {...rest, score_text}).set(4, {...rest, started, score_text: '{"metr'}).set(5, {...rest, started: 5, score_text});
        rows.set(6, null).set(7, 'unreadable').set(8, {...rest, started: 'yesterday', score_text}).set(9, {...attempt_of(9), id: 9});
        const all = await page.kept_attempts();
        expect_equal(all.map(({id, damaged}) => `${id}${damaged ? 'x' : ''}`).join(), '1,2x,3x,4x,5x,6x,7x,8x,9', 'each for itself');
        for (const {id, damaged} of all) if (damaged) await page.remove_attempt(id);
        expect_equal((await page.kept_attempts()).map(({id}) => id).join(), '1,9', 'they can be removed');
    },
    async an_older_page_in_another_tab_holds_up_nothing() {
        const storage = globalThis.indexedDB = kept_storage({blocked: true}), page = await open_page();
        let late = false;
        page.when_store_opens(() => { late = true; });
        expect_equal(await page.kept_attempts(), null, 'nothing is kept');
        expect_equal(page.store_waits(), true, 'and it is known why');
        expect_equal(await page.keep_attempt(attempt_of(1)), false, 'in this page alone');
        storage.free();
        for (let n = 0; n < 100 && !late; ++n) await new Promise((done) => setTimeout(done, 5));
        expect(late && !page.store_waits(), 'open, once that tab is closed');
        expect_equal((await page.kept_attempts()).map(({in_page}) => Boolean(in_page)).join(), 'false', 'kept now');
    },
    async a_page_lets_go_of_the_store_for_a_newer_one_and_works_with_what_that_left() {
        const storage = globalThis.indexedDB = kept_storage(), page = await open_page();
        await page.keep_attempt(attempt_of(1));
        const {db} = storage;
        db.onversionchange();
        expect(db.closed, 'closed');
        expect_equal((await page.kept_attempts()).length, 1, 'opened again');
        // The browser closes it, where the site's data are cleared.
        storage.db.closed = true;
        storage.stores.get('attempts').rows.clear();
        expect_equal((await page.kept_attempts()).length, 0, 'cleared');
        expect_equal(await page.keep_attempt(attempt_of(2)), true, 'kept again');
        const newer = globalThis.indexedDB = kept_storage({version: 9});
        newer.make('attempts', {keyPath: 'id'});
        newer.make('recordings', {keyPath: 'id'});
        expect_equal(await (await open_page()).keep_attempt(attempt_of(3)), true, 'a newer store is used as it is');
    },
    async a_list_that_is_read_while_the_browser_clears_is_empty_and_not_refused() {
        const storage = globalThis.indexedDB = kept_storage(), page = await open_page();
        await page.keep_attempt(attempt_of(1));
        storage.clears = true;
        expect_equal((await page.kept_attempts())?.length, 0, 'attempts');
        expect_equal(await page.keep_attempt(attempt_of(2)), true, 'kept again');
    },
    async hundreds_go_in_pieces() {
        globalThis.indexedDB = kept_storage();
        const page = await open_page();
        let up = false;
        await with_store(() => (up ? 204 : 500), async (store, endpoint) => {
            for (let n = 0; n < 60; ++n) await page.send_statements(endpoint, three(page));
            up = true;
            expect_equal((await page.send_statements(endpoint, [])).waiting, 0, 'waiting');
            expect_equal(store.has.size, 180, 'taken');
            expect(store.requests.every(({count}) => count <= 50), 'pieces');
        });
    },
    async one_that_is_refused_or_known_does_not_hold_up_the_others() {
        globalThis.indexedDB = kept_storage();
        const page = await open_page();
        const statements = three(page);
        const bad = (one) => one.id === statements[1].id, known = (one) => one.id === statements[0].id;
        await with_store((all) => (all.some(bad) ? 400 : all.some(known) ? 409 : 200), async (store, endpoint) => {
            const sent = await page.send_statements(endpoint, statements);
            expect_equal(`${sent.waiting} ${sent.refused}`, '0 1', 'waiting and refused');
            expect(page.words_of_sending(sent).includes('refuses 1'), 'said');
            expect_equal([...store.has.keys()].join(), statements[2].id, 'the third is there');
        });
    },
    async a_launch_says_who_where_and_with_which_key() {
        globalThis.indexedDB = undefined;
        const page = await open_page();
        const launch = page.launch_of(`?case=demo&endpoint=${encodeURIComponent('https://store.example.org/other/')}`
            + `&auth=${encodeURIComponent('Basic abc')}&actor=${encodeURIComponent(JSON.stringify({name: ['A. Trainee'], mbox: ['mailto:a@example.org']}))}`
            + '&registration=760e3480-ba55-4991-94b0-01820dbd23a2&activity_id=https%3A%2F%2Fexample.org%2Fliver', 'https://store.example.org/xapi');
        expect_equal(launch.endpoint, 'https://store.example.org/other/', 'endpoint');
        expect_equal(launch.auth, 'Basic abc', 'auth');
        const one = page.statement('scored', attempt, score, launch);
        expect_equal(JSON.stringify(one.actor), '{"name":"A. Trainee","mbox":"mailto:a@example.org","objectType":"Agent"}', 'actor');
        expect_equal(one.context.registration, '760e3480-ba55-4991-94b0-01820dbd23a2', 'registration');
        expect_equal(one.object.id, 'https://example.org/liver', 'activity');
        expect_equal(one.result.score.scaled, 0.5, 'scaled');
        expect(/^PT\d+\.\d\dS$/.test(one.result.duration), one.result.duration);
        for (const search of ['', '?endpoint=https://thief.example.org/', '?endpoint=https://store.example.org/&actor={'])
            expect_equal(page.launch_of(search, 'https://store.example.org/xapi'), null, search);
        expect_equal(page.launch_of('?endpoint=https://store.example.org/', ''), null, 'a site without a store');
    },
    async a_checklist_goes_with_its_points_and_moments() {
        globalThis.indexedDB = undefined;
        const page = await open_page();
        const procedure = {points: 3, max_points: 4, complications: [{name: 'bleeding', time_s: 9}],
            items: [{name: 'numbed', title: 'Way numbed', critical: true, ticked: true, time_s: 5}, {name: 'pressed', critical: false, ticked: false, time_s: null, why: 'not_done'}]};
        const one = page.statement('scored', attempt, {...score, procedure});
        expect_equal(one.result.score.scaled, 0.75, 'scaled');
        expect_equal(one.result.score.max, 4, 'max');
        const list = Object.entries(one.result.extensions).find(([name]) => name.endsWith('#checklist'))[1];
        expect_equal(JSON.stringify(list), '[{"name":"numbed","ticked":true,"critical":true,"time_s":5},{"name":"pressed","ticked":false,"critical":false,"time_s":null,"why":"not_done"}]', 'list');
    },
    async ids_are_there_and_differ_in_pages_that_are_not_secure() {
        globalThis.indexedDB = undefined;
        const secure = crypto.randomUUID;
        try {
            Object.defineProperty(crypto, 'randomUUID', {value: undefined, configurable: true});
            const page = await open_page(), ids = new Set();
            for (let n = 0; n < 100; ++n) {
                const {id} = page.statement('attempted', attempt, null);
                expect(/^[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}$/.test(id), id);
                ids.add(id);
            }
            expect_equal(ids.size, 100, 'ids');
        } finally {
            Object.defineProperty(crypto, 'randomUUID', {value: secure, configurable: true});
        }
    },
});
