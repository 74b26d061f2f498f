// SPDX-License-Identifier: Apache-2.0

// Statements to a learning record store (runtime/web/page/results.js), in node: with a store that answers as those of
// learning platforms do, or does not, and with a browser that keeps things or does not.
import {createServer} from 'node:http';
import {webcrypto} from 'node:crypto';
import {expect, expect_equal, run_tests} from './support.mjs';

globalThis.crypto ??= webcrypto;
globalThis.location = {href: 'https://site.example.org/ward/index.html?case=demo'};
let pages = 0;
// The module anew, as a page that opens.
const open_page = () => import(`../../../runtime/web/page/results.js?${++pages}`);

// As much of IndexedDB as results.js uses; what it holds stays when a page opens anew.
function kept_storage() {
    const stores = new Map();
    const answer = (result) => {
        const asked = {};
        setTimeout(() => { asked.result = result(); asked.onsuccess?.(); }, 0);
        return asked;
    };
    const db = {
        objectStoreNames: {contains: (name) => stores.has(name)},
        createObjectStore: (name, {keyPath}) => stores.set(name, {keyPath, next: 1, rows: new Map()}),
        transaction: () => ({objectStore: (name) => {
            const of = stores.get(name);
            return {
                add: (row) => answer(() => { of.rows.set(of.next, {...structuredClone(row), [of.keyPath]: of.next}); return of.next++; }),
                getAll: () => answer(() => [...of.rows.values()]),
                delete: (key) => answer(() => of.rows.delete(key)),
                clear: () => answer(() => of.rows.clear()),
            };
        }}),
    };
    return {open: () => {
        const opening = {};
        setTimeout(() => { opening.result = db; opening.onupgradeneeded?.(); opening.onsuccess?.(); }, 0);
        return opening;
    }};
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
