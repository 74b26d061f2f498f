// SPDX-License-Identifier: Apache-2.0

// What a course keeps and hands over (runtime/web/page/lms.js), in node: with platforms that hold it to public rules
// (platform.mjs), without a network for a while, loaded again in the middle, in two tabs.
import {readFileSync} from 'node:fs';
import {webcrypto} from 'node:crypto';
import {expect, expect_equal, run_tests} from './support.mjs';
import {Cmi5Platform, scorm_api} from './platform.mjs';

globalThis.crypto ??= webcrypto;
globalThis.location = {href: 'https://site.example.org/index.html'};
globalThis.indexedDB = undefined;
const source = ['results.js', 'lms.js'].map((name) => readFileSync(new URL(`../../../runtime/web/page/${name}`, import.meta.url), 'utf8')
    .replaceAll(/^import .*$/gm, '')).join('\n');
const {KeptCourse, find_api, hold_alone, merged_states, module_state, module_text, new_module_state, platform_of, preferred_language, statement} =
    await import(`data:text/javascript,${encodeURIComponent(source)}`);

function storage() {
    const kept = new Map();
    const of = {full: false, kept, getItem: (key) => kept.get(key) ?? null, removeItem: (key) => { kept.delete(key); },
        setItem: (key, value) => {
            if (of.full && String(value).length > (kept.get(key) ?? '').length) throw new Error('QuotaExceededError');
            kept.set(key, String(value));
        }};
    return of;
}
// Pages of one browser share `local`; `session` is a tab's own. Timers run when the clock is moved.
function browser_of({local = storage(), session = storage(), api = {}, page = 'https://site.example.org/index.html?module=look', fetch = null, clock = {ms: 1.8e12, timers: []}} = {}) {
    const window = {parent: {parent: null, ...api}, setInterval: (what, every_ms) => { clock.timers.push({what, every_ms, at: clock.ms + every_ms}); }, addEventListener: () => {}};
    window.parent.parent = window.parent;
    return {window, local, session, fetch, page, clock, locks: undefined, patience_ms: 50, now_ms: () => clock.ms, id: () => crypto.randomUUID()};
}
async function pass_seconds(clock, seconds) {
    for (const end = clock.ms + 1000 * seconds; clock.ms < end;) {
        clock.ms = Math.min(end, Math.min(...clock.timers.map((one) => one.at), end));
        for (const one of clock.timers) if (one.at <= clock.ms) { one.at += one.every_ms; await one.what(); }
    }
}
async function kept_course(kind, browser) {
    const kept = new KeptCourse('first', ['look'], 'Ada', platform_of(kind, '', browser), browser);
    await kept.begin();
    return kept;
}
// An attempt that ended now; part and passed as the program's gate gives them.
function attempt(kept, browser, good, part, passed = part >= 1) {
    const state = kept.state('look');
    state.attempts.push({started_ms: browser.now_ms(), passed: good, exam: false});
    state.phase = 'practice';
    kept.save('look', part, passed, '2026-02-03');
}
// The platform's answers over a network that may be away. platform.stumbles(method, address, body): a status in the place
// of its answer, 0 for no network, 'never' for no answer at all; undefined: it answers.
function network(platform) {
    return async (address, {method = 'GET', headers = {}, body = ''} = {}) => {
        const instead = platform.stumbles?.(method, address, body);
        if (instead === 'never') return new Promise(() => {});
        if (!platform.online || instead === 0) throw new TypeError('no network');
        if (instead) return {status: instead, ok: false, text: async () => '', json: async () => ({})};
        const lower = Object.fromEntries(Object.entries(headers).map(([name, value]) => [name.toLowerCase(), value]));
        const {status, text} = platform.handle(method, address, lower, body);
        return {status, ok: status >= 200 && status < 300, text: async () => text, json: async () => JSON.parse(text)};
    };
}
function cmi5_browser(platform, more = {}) {
    return browser_of({page: `https://site.example.org/index.html?module=look&${more.launch ?? platform.launch()}`, fetch: network(platform), ...more});
}
const scored = (passed, at_ms = 1.8e12) => [Object.assign(statement('scored', {started: '2026-01-31T12:00:00Z', trainee: 'Ada', case_name: 'demo', exercise: 'liver', title: 'Liver'},
    {passed, metrics: {}, pass_marks: [{passed}]}), {timestamp: new Date(at_ms).toISOString()})];

await run_tests({
    async a_state_comes_back_from_its_text_and_fits_where_little_may_be_kept() {
        const state = new_module_state();
        Object.assign(state, {phase: 'practice', option: 2, value: 0.25, told: '2026-02-03'});
        for (let n = 0; n < 2000; ++n) state.attempts.push({started_ms: 1.77e12 + 86400e3 * n, passed: n % 3 > 0, exam: n % 5 === 0});
        const text = module_text(state), back = module_state(text);
        expect(text.length <= 4000 && back.attempts.length > 500, `${text.length} letters, ${back.attempts.length} attempts`);
        expect_equal(JSON.stringify(back.attempts.at(-1)), JSON.stringify(state.attempts.at(-1)), 'the newest stays');
        expect_equal(back.attempts.at(0).started_ms, state.attempts.at(-back.attempts.length).started_ms, 'the first that is left has its time');
        expect_equal(`${back.phase} ${back.option} ${back.value} ${back.told}`, 'practice 2 0.25 2026-02-03', 'the rest');
        for (const damaged of ['', 'null', '{}', '{"v":1}', '{"v":3,"a":""}', '{"v":2,"a":"1Q"}', '{"v":2,"a":5}', text.slice(0, 50)])
            expect_equal(module_state(damaged), null, damaged);
        const odd = module_state('{"v":2,"p":"moon","o":77,"a":"aP","x":"1","t":5}');
        expect_equal(JSON.stringify(odd), JSON.stringify({...new_module_state(), attempts: [{started_ms: 10, passed: true, exam: false}]}), 'what makes no sense is left out');
        expect_equal(module_state('{"v":1,"p":"text","o":0,"a":"aPzX","x":4,"t":""}').attempts.map((one) => one.started_ms).join(), '10000,45000', 'an older text, in seconds');
    },
    async a_clock_that_is_set_back_loses_nothing() {
        const state = new_module_state();
        for (const [started_ms, passed] of [[5000, true], [9000, false], [2000, true], [9000, true]]) state.attempts.push({started_ms, passed, exam: false});
        expect_equal(module_state(module_text(state)).attempts.map((one) => `${one.started_ms}${one.passed}`).join(), '2000true,5000true,9000false,9000true', 'back from its text');
        expect_equal(state.attempts[0].started_ms, 5000, 'what is written stays as it is');
        expect_equal(module_state(`{"v":2,"p":"text","o":0,"a":"${(5000).toString(36)}P${(-3000).toString(36)}F","x":4,"t":""}`).attempts.map((one) => one.started_ms).join(), '2000,5000',
            'an older text, with a falling time');
        const of_platform = new Map(), browser = browser_of({api: {API: scorm_api(false, of_platform)}}), kept = await kept_course('scorm12', browser);
        for (const back_ms of [0, 3600e3, -60e3]) {
            browser.clock.ms -= back_ms;
            attempt(kept, browser, true, 0.5);
        }
        expect_equal(kept.state('look').attempts.map((one) => one.started_ms - 1.8e12).join(), '-3600000,-3540000,0', 'in the order of their times');
        for (const local of [browser.local, storage()]) {
            const again = await kept_course('scorm12', browser_of({local, api: {API: scorm_api(false, of_platform)}}));
            expect(again.state('look').attempts.length === 3 && !again.damaged, 'kept here and by the platform');
        }
    },
    async two_copies_lose_nothing_of_either() {
        const one = module_state('{"v":2,"p":"practice","o":1,"a":"aPaF","x":3,"t":""}'), other = module_state('{"v":2,"p":"text","o":0,"a":"aPzX","x":4,"t":"2026-02-03"}');
        for (const [a, b] of [[one, other], [other, one]]) {
            const both = merged_states(a, b);
            expect_equal(both.attempts.map((attempt) => attempt.started_ms).join(), '10,20,45', 'attempts, also of one second');
            expect_equal(`${both.phase} ${both.value} ${both.told}`, 'practice 4 2026-02-03', 'the rest');
        }
        expect_equal(merged_states(null, one), one, 'one alone');
    },
    async the_api_is_found_above_and_in_the_window_that_opened_this_one() {
        const top = {API: 1}, middle = {parent: top}, strange = {get API() { throw new Error('SecurityError'); }};
        top.parent = top;
        const own = {};
        own.parent = own;
        expect_equal(find_api({parent: middle}, 'API'), 1, 'two windows above');
        expect_equal(find_api(Object.assign({opener: {parent: middle}}, {parent: null}), 'API'), 1, 'above the opener');
        expect_equal(find_api({parent: strange}, 'API'), null, 'a window of another site');
        expect_equal(find_api(Object.assign(own, {opener: null}), 'API'), null, 'nowhere');
    },
    async scorm_is_told_what_is_under_way_and_of_the_pass() {
        for (const kind of ['scorm12', 'scorm2004']) {
            const is_2004 = kind === 'scorm2004', of_platform = new Map(), api = scorm_api(is_2004, of_platform);
            const browser = browser_of({api: {[is_2004 ? 'API_1484_11' : 'API']: api}});
            const kept = await kept_course(kind, browser);
            kept.state('look').option = 1;
            kept.save('look', 0, false, '2026-02-03');
            await pass_seconds(browser.clock, 90);
            attempt(kept, browser, false, 0);
            attempt(kept, browser, true, 0.5);
            const [status, success] = is_2004 ? ['cmi.completion_status', 'cmi.success_status'] : ['cmi.core.lesson_status', 'cmi.core.lesson_status'];
            const score = is_2004 ? 'cmi.score.raw' : 'cmi.core.score.raw';
            expect_equal(of_platform.get(status), 'incomplete', 'under way');
            expect_equal(of_platform.get(score) ?? '', '', 'no score that would fail the module');
            expect_equal(Number(of_platform.get(is_2004 ? 'cmi.progress_measure' : 'cmi.objectives.0.score.raw')), is_2004 ? 0.5 : 50, 'how far');
            expect_equal(of_platform.get(is_2004 ? 'cmi.location' : 'cmi.core.lesson_location'), 'look/practice', 'bookmark');
            attempt(kept, browser, true, 1);
            expect_equal(of_platform.get(success), 'passed', 'pass');
            expect_equal(of_platform.get(score), '100', 'score');
            kept.platform.leave();
            expect_equal(of_platform.get(is_2004 ? 'cmi.session_time' : 'cmi.core.session_time'), is_2004 ? 'PT90.00S' : '0000:01:30.00', 'time');
            expect_equal(api.ended, 1, 'ended once');
            kept.platform.leave();
            expect_equal(api.ended, 1, 'and no more');
            expect_equal(api.faults.join('\n'), '', kind);
            // Another browser: the platform's copy is enough.
            const again = scorm_api(is_2004, of_platform), elsewhere = browser_of({api: {[is_2004 ? 'API_1484_11' : 'API']: again}});
            const resumed = await kept_course(kind, elsewhere);
            expect_equal(resumed.state('look').attempts.length, 3, 'resumed');
            expect_equal(resumed.state('look').option, 1, 'with the answer');
            expect_equal(again.faults.join('\n'), '', kind);
        }
    },
    async scorm_survives_ten_minutes_without_network_and_being_loaded_again() {
        for (const [kind, reopens] of [['scorm12', true], ['scorm12', false], ['scorm2004', false]]) {
            const is_2004 = kind === 'scorm2004', of_platform = new Map();
            let online = true;
            const api = scorm_api(is_2004, of_platform, {online: () => online, reopens}), apis = {[is_2004 ? 'API_1484_11' : 'API']: api};
            const browser = browser_of({api: apis});
            const kept = await kept_course(kind, browser);
            online = false;
            attempt(kept, browser, true, 0.5);
            expect_equal(kept.platform.waiting(), 1, 'it waits');
            await pass_seconds(browser.clock, 600);
            expect_equal(of_platform.size, 0, 'nothing got through');
            online = true;
            await pass_seconds(browser.clock, 15);
            expect_equal(kept.platform.waiting(), 0, 'nothing waits any more');
            expect(of_platform.get('cmi.suspend_data').includes('P'), 'the attempt is there');
            // Loaded again: the old page ends its session. Strict platforms open no second one.
            kept.platform.leave();
            const tab = {...browser, ...browser_of({local: browser.local, session: browser.session, api: apis, clock: browser.clock})};
            const loaded = await kept_course(kind, tab);
            expect_equal(loaded.state('look').attempts.length, 1, 'nothing is lost');
            expect_equal(loaded.platform.words, reopens ? '' : 'session_over', kind);
            tab.clock.ms += 60000;
            attempt(loaded, tab, true, 1);
            // A new launch takes over what this browser kept.
            const next = scorm_api(is_2004, of_platform), fresh = browser_of({local: browser.local, api: {[is_2004 ? 'API_1484_11' : 'API']: next}, clock: browser.clock});
            const relaunched = await kept_course(kind, fresh);
            expect_equal(relaunched.state('look').attempts.length, 2, 'both attempts');
            relaunched.save('look', 1, true, '2026-02-03');
            expect_equal(of_platform.get(is_2004 ? 'cmi.success_status' : 'cmi.core.lesson_status'), 'passed', 'the pass is told then');
            expect_equal([...api.faults, ...next.faults].join('\n'), '', kind);
        }
    },
    async a_new_attempt_on_a_scorm_platform_begins_anew() {
        for (const kind of ['scorm12', 'scorm2004']) {
            const is_2004 = kind === 'scorm2004', local = storage(), passed = is_2004 ? 'cmi.success_status' : 'cmi.core.lesson_status';
            let online = true;
            const launch = (of_platform) => browser_of({local, api: {[is_2004 ? 'API_1484_11' : 'API']: scorm_api(is_2004, of_platform, {online: () => online})}, clock: {ms: 1.8e12 + 1000 * local.kept.size, timers: []}});
            const begin = async (of_platform) => {
                const browser = launch(of_platform), kept = await kept_course(kind, browser);
                return {browser, kept, done: () => kept.state('look').attempts.length};
            };
            const first = new Map();
            let {browser, kept, done} = await begin(first);
            attempt(kept, browser, true, 1);
            kept.platform.leave();
            expect_equal(first.get(passed), 'passed', 'the first attempt');
            // The teacher resets it: the platform keeps nothing.
            const second = new Map();
            ({browser, kept, done} = await begin(second));
            expect_equal(`${done()} ${kept.state('look').told}`, '0 ', 'nothing is done');
            kept.save('look', 0, false, '2026-02-04');
            kept.platform.leave();
            expect(second.get(passed) !== 'passed', 'nor passed');
            // What the platform never had is not lost: neither all of an attempt nor what followed.
            ({browser, kept, done} = await begin(second));
            online = false;
            browser.clock.ms += 60e3;
            attempt(kept, browser, true, 0.5);
            kept.platform.leave();
            online = true;
            ({browser, kept, done} = await begin(new Map()));
            expect_equal(done(), 1, 'what no platform was given stays');
            // The platform's own copy is of another attempt: what it was given of the first does not come back.
            attempt(kept, browser, true, 0.5);
            kept.platform.leave();
            const elsewhere = browser_of({api: {[is_2004 ? 'API_1484_11' : 'API']: scorm_api(is_2004, second)}}), other = await kept_course(kind, elsewhere);
            other.save('look', 0, false, '2026-02-04');
            other.platform.leave();
            ({browser, kept, done} = await begin(second));
            expect_equal(done(), 0, 'each copy its own');
        }
        // Of states that an earlier version kept it is not known: a pass was told, the rest may wait.
        for (const [text, left] of [['{"v":2,"p":"practice","o":1,"a":"aPaP","x":3,"t":"2026-01-01"}', 0], ['{"v":2,"p":"practice","o":1,"a":"aP","x":3,"t":""}', 1]]) {
            const browser = browser_of({api: {API: scorm_api(false, new Map())}});
            browser.local.setItem('sonocase-course first u-7 look', text);
            expect_equal((await kept_course('scorm12', browser)).state('look').attempts.length, left, text);
        }
    },
    async a_scorm_platform_that_refuses_a_value_and_commits_is_asked_again() {
        for (const is_2004 of [false, true]) {
            for (const refused of is_2004 ? ['cmi.suspend_data', 'cmi.success_status', 'cmi.score.scaled'] : ['cmi.suspend_data', 'cmi.core.lesson_status', 'cmi.core.score.raw']) {
                const of_platform = new Map(), api = scorm_api(is_2004, of_platform), name = is_2004 ? 'SetValue' : 'LMSSetValue', take = api[name];
                const browser = browser_of({api: {[is_2004 ? 'API_1484_11' : 'API']: api}}), kept = await kept_course(is_2004 ? 'scorm2004' : 'scorm12', browser);
                api[name] = (...what) => what[0] === refused ? 'false' : take(...what);
                attempt(kept, browser, true, 1);
                await pass_seconds(browser.clock, 60);
                expect_equal(kept.platform.waiting(), 1, `${refused} waits`);
                api[name] = take;
                await pass_seconds(browser.clock, 15);
                expect_equal(kept.platform.waiting(), 0, 'no longer');
                expect_equal(of_platform.get(is_2004 ? 'cmi.success_status' : 'cmi.core.lesson_status'), 'passed', refused);
            }
        }
    },
    async a_page_without_its_platform_says_so_and_keeps_progress() {
        for (const kind of ['scorm12', 'scorm2004', 'cmi5']) {
            const browser = browser_of();
            const kept = await kept_course(kind, browser);
            expect_equal(kept.platform.words, 'no_platform', kind);
            attempt(kept, browser, true, 1);
            expect_equal((await kept_course(kind, browser)).state('look').attempts.length, 1, 'kept');
        }
        const nothing = browser_of({local: null, session: null});
        const kept = await kept_course('', nothing);
        attempt(kept, nothing, true, 1);
        expect_equal(kept.keeps, false, 'a browser that keeps nothing is known');
        const damaged = browser_of();
        damaged.local.setItem('sonocase-course first Ada look', 'holiday');
        expect((await kept_course('', damaged)).damaged, 'damage is known');
    },
    async cmi5_has_its_statements_in_their_order() {
        const platform = new Cmi5Platform('https://platform.example.org', {returnURL: 'https://platform.example.org/back'});
        const browser = cmi5_browser(platform), kept = await kept_course('cmi5', browser);
        expect_equal(kept.platform.words, '', 'launched');
        browser.clock.ms += 60000;
        kept.platform.attempted(scored(false), true);
        attempt(kept, browser, false, 0);
        expect_equal(await kept.platform.end(), 'https://platform.example.org/back', 'the way back');
        expect_equal(platform.verbs().join(), 'initialized,scored,failed,terminated', 'a session without a pass');
        expect_equal(platform.statements[2].result.duration, 'PT60.00S', 'time');
        // The next session passes, and a third does not pass or fail again.
        const second = cmi5_browser(platform, {clock: browser.clock}), resumed = await kept_course('cmi5', second);
        expect_equal(resumed.state('look').attempts.length, 1, 'resumed from the platform');
        second.clock.ms += 60000;
        resumed.platform.attempted(scored(true), true);
        attempt(resumed, second, true, 1);
        await resumed.platform.end();
        const third = cmi5_browser(platform, {clock: browser.clock}), after = await kept_course('cmi5', third);
        third.clock.ms += 60000;
        after.platform.attempted(scored(false), true);
        attempt(after, third, false, 1, true);
        await after.platform.end();
        expect_equal(platform.verbs().slice(4).join(), 'initialized,scored,completed,passed,terminated,initialized,scored,terminated', 'later sessions');
        expect_equal(platform.faults.join('\n'), '', 'rules');
    },
    async cmi5_survives_ten_minutes_without_network_and_being_loaded_again() {
        const platform = new Cmi5Platform('https://platform.example.org'), launch = platform.launch();
        const browser = cmi5_browser(platform, {launch}), kept = await kept_course('cmi5', browser);
        platform.online = false;
        for (let n = 0; n < 30; ++n) {
            browser.clock.ms += 10000;
            kept.platform.attempted(scored(true, browser.clock.ms), true);
        }
        attempt(kept, browser, true, 0.5);
        await pass_seconds(browser.clock, 600);
        expect_equal(platform.verbs().join(), 'initialized', 'nothing got through');
        // Loaded again, still without a network: the key and the launch's data are those of before.
        browser.clock.timers.length = 0;  // those of the page that is gone
        const same = {launch, local: browser.local, session: browser.session, clock: browser.clock};
        const loaded_tab = cmi5_browser(platform, same), loaded = await kept_course('cmi5', loaded_tab);
        expect_equal(loaded.platform.words, '', 'the session goes on');
        expect_equal(loaded.state('look').attempts.length, 1, 'nothing is lost');
        attempt(loaded, loaded_tab, true, 1);
        platform.online = true;
        await pass_seconds(browser.clock, 15);
        await loaded.platform.end();
        expect_equal(platform.verbs().join(), ['initialized', ...new Array(30).fill('scored'), 'completed', 'passed', 'terminated'].join(), 'all, once, in order');
        const times = platform.statements.map((one) => one.timestamp);
        expect_equal(times.join(), [...times].sort().join(), 'with the times at which they happened');
        expect_equal(platform.faults.join('\n'), '', 'rules');
    },
    async cmi5_hands_over_later_what_a_session_that_broke_off_left() {
        const platform = new Cmi5Platform('https://platform.example.org');
        const browser = cmi5_browser(platform), kept = await kept_course('cmi5', browser);
        platform.online = false;
        kept.platform.attempted(scored(true), true);
        attempt(kept, browser, true, 1);
        await kept.hand_over();
        platform.online = true;  // the tab was closed meanwhile; the platform counts its session as abandoned
        const next = cmi5_browser(platform, {local: browser.local, clock: browser.clock}), resumed = await kept_course('cmi5', next);
        resumed.save('look', 1, true, '2026-02-04');
        await resumed.platform.end();
        expect_equal(platform.verbs().join(), 'initialized,initialized,scored,completed,passed,terminated', 'the pass comes with the next session');
        expect_equal(platform.faults.join('\n'), '', 'rules');
    },
    async a_launch_that_is_no_good_is_said_and_works_without_its_platform() {
        const platform = new Cmi5Platform('https://platform.example.org'), launch = platform.launch();
        await kept_course('cmi5', cmi5_browser(platform, {launch}));
        // The same launch in another tab: its key was given.
        const second = cmi5_browser(platform, {launch}), kept = await kept_course('cmi5', second);
        expect_equal(kept.platform.words, 'key_expired', 'the key');
        attempt(kept, second, true, 1);
        expect_equal(kept.state('look').told, '', 'the platform was told nothing');
        // What was kept meanwhile is told by the next launch.
        const third = cmi5_browser(platform, {local: second.local, clock: second.clock}), later = await kept_course('cmi5', third);
        later.save('look', 1, true, '2026-02-04');
        await later.platform.end();
        expect_equal(platform.verbs().join(), 'initialized,initialized,completed,passed,terminated', 'told');
        expect_equal(platform.faults.join('\n'), '', 'rules');
        for (const [address, words] of [['endpoint=https://x/', 'bad_launch'], [launch.replace(/actor=[^&]*/, 'actor=%7B'), 'bad_launch']])
            expect_equal((await kept_course('cmi5', cmi5_browser(platform, {launch: address}))).platform.words, words, address);
        const away = cmi5_browser(platform);
        platform.online = false;
        expect_equal((await kept_course('cmi5', away)).platform.words, 'no_answer', 'no network at the launch');
    },
    async cmi5_writes_nothing_over_what_could_not_be_read() {
        for (const failure of [500, 401, 0, 'never']) {
            const platform = new Cmi5Platform('https://platform.example.org');
            const browser = cmi5_browser(platform), kept = await kept_course('cmi5', browser);
            attempt(kept, browser, true, 1);
            await kept.platform.end();
            const before = platform.documents.get('sonocase.module');
            // On another computer, whose first reads fail.
            let failing = true;
            platform.stumbles = (method, address) => failing && method === 'GET' && address.includes('sonocase.module') ? failure : undefined;
            const other = cmi5_browser(platform, {clock: {ms: browser.clock.ms + 3600e3, timers: []}}), resumed = await kept_course('cmi5', other);
            attempt(resumed, other, true, 1);
            await pass_seconds(other.clock, 30);
            expect_equal(platform.documents.get('sonocase.module'), before, `${failure}: nothing is written over`);
            expect_equal(platform.verbs().join(), 'initialized,completed,passed,terminated,initialized', `${failure}: nor is a pass told again`);
            expect(resumed.platform.waiting() > 0, `${failure}: it waits`);
            failing = false;
            await pass_seconds(other.clock, 15);
            expect_equal(resumed.state('look').attempts.length, 2, `${failure}: both attempts once it answers`);
            expect_equal(resumed.state('look').told, '2026-02-03', `${failure}: and the pass`);
            await resumed.platform.end();
            expect_equal(module_state(platform.documents.get('sonocase.module')).attempts.length, 2, `${failure}: on the platform`);
            expect_equal(platform.verbs().join(), 'initialized,completed,passed,terminated,initialized,terminated', `${failure}: no Failed`);
            expect_equal(platform.faults.join('\n'), '', 'rules');
        }
    },
    async cmi5_waits_for_a_platform_that_is_slow_or_stumbles() {
        for (const [place, failure] of [['/fetch', 0], ['/fetch', 503], ['LMS.LaunchData', 503], ['LMS.LaunchData', 0], ['LMS.LaunchData', 'never'], ['agents/profile', 'never'], ['agents/profile', 500]]) {
            const platform = new Cmi5Platform('https://platform.example.org');
            let stumbles = 1;
            platform.stumbles = (method, address) => address.includes(place) && stumbles-- > 0 ? failure : undefined;
            const browser = cmi5_browser(platform), kept = new KeptCourse('first', ['look'], 'Ada', platform_of('cmi5', '', browser), browser);
            const begun = kept.begin();
            expect_equal(`${kept.platform.words} ${kept.platform.learner !== ''}`, 'asking true', `${place}: it is known at once who the learner is`);
            // What is done meanwhile.
            kept.platform.attempted(scored(true), true);
            attempt(kept, browser, true, 1);
            await begun;
            expect_equal(kept.platform.words, place.includes('profile') ? '' : 'no_answer', `${place} ${failure}: said`);
            await pass_seconds(browser.clock, 15);
            expect_equal(kept.platform.words, '', `${place} ${failure}: and no longer`);
            await kept.platform.end();
            expect_equal(platform.verbs().join(), 'initialized,scored,completed,passed,terminated', `${place} ${failure}: statements`);
            expect_equal(platform.faults.join('\n'), '', 'rules');
        }
        // A fetch address that never answers again: by the time, and no more.
        const platform = new Cmi5Platform('https://platform.example.org');
        platform.stumbles = () => 'never';
        const kept = await kept_course('cmi5', cmi5_browser(platform));
        expect_equal(`${kept.platform.words} ${kept.platform.asks}`, 'no_answer true', 'said, and asked again');
        // None is an answer, and the last.
        const none = new Cmi5Platform('https://platform.example.org'), browser = cmi5_browser(none);
        none.documents.delete('LMS.LaunchData');
        const without = await kept_course('cmi5', browser), asked = none.requests;
        expect_equal(without.platform.words, 'no_launch_data', 'no data');
        await pass_seconds(browser.clock, 60);
        expect_equal(none.requests, asked, 'it is not asked for again');
    },
    async cmi5_loses_no_pass_where_the_browser_is_full() {
        for (const closes of [false, true]) {
            const platform = new Cmi5Platform('https://platform.example.org');
            const browser = cmi5_browser(platform), kept = await kept_course('cmi5', browser);
            platform.online = false;
            kept.platform.attempted(scored(false), true);
            attempt(kept, browser, true, 0.5);
            await kept.hand_over();
            browser.local.full = true;
            attempt(kept, browser, true, 1);
            kept.platform.attempted(scored(true), true);
            await kept.hand_over();
            expect(kept.platform.waits_in_page(), 'it is known that this waits in the page alone');
            browser.local.full = false;
            if (closes) {
                // Closed too early: storage has the older list, and no word of a pass that was told.
                const next = cmi5_browser(platform, {local: browser.local, clock: browser.clock});
                kept.save('look', 1, true, '2026-02-03');
                browser.clock.timers.length = 0;
                platform.online = true;
                const resumed = await kept_course('cmi5', next);
                expect_equal(resumed.state('look').told, '', 'not told');
                resumed.save('look', 1, true, '2026-02-04');
                await resumed.platform.end();
                expect_equal(platform.verbs().join(), 'initialized,initialized,scored,completed,passed,terminated', 'told by the next launch');
            } else {
                platform.online = true;
                await pass_seconds(browser.clock, 15);
                expect(!kept.platform.waits_in_page(), 'nothing waits any more');
                expect_equal(platform.verbs().join(), 'initialized,scored,completed,passed,scored', 'all, once, in order');
                expect_equal(module_state(platform.documents.get('sonocase.module')).told, '2026-02-03', 'told, also where it is kept');
            }
            expect_equal(platform.faults.join('\n'), '', 'rules');
        }
    },
    async a_pass_that_cmi5_refuses_is_told_once_more_in_a_session() {
        for (const refuses of [1, 2, 99]) {
            const platform = new Cmi5Platform('https://platform.example.org');
            let refused = 0, tried = 0;
            platform.stumbles = (method, address, body) => {
                if (!address.endsWith('/statements') || !body.includes('verbs/passed')) return undefined;
                if (JSON.parse(body).length === 1) ++tried;
                if (refused >= refuses) return undefined;
                if (JSON.parse(body).length === 1) ++refused;
                return 400;
            };
            const browser = cmi5_browser(platform), kept = await kept_course('cmi5', browser);
            attempt(kept, browser, true, 1);
            await pass_seconds(browser.clock, 120);
            if (refuses === 1) {
                expect_equal(`${platform.verbs().join()} ${kept.state('look').told} ${kept.platform.pass_refused}`, 'initialized,completed,passed 2026-02-03 false', 'taken the second time');
                continue;
            }
            expect_equal(`${tried} ${kept.state('look').told} ${kept.platform.pass_refused} ${kept.platform.refused}`, '2  true 2', 'twice in a session, and it is said');
            expect_equal(module_state(platform.documents.get('sonocase.module')).told, '', 'nor is it kept as told');
            await kept.platform.end();
            expect_equal(platform.verbs().join(), 'initialized,completed,terminated', 'whoever passed has not failed');
            const next = cmi5_browser(platform, {local: browser.local, clock: browser.clock}), resumed = await kept_course('cmi5', next);
            resumed.save('look', 1, true, '2026-02-04');
            await resumed.hand_over();
            expect_equal(tried, 3, 'the next session tells it again');
            expect_equal(platform.verbs().join(), `initialized,completed,terminated,initialized${refuses === 2 ? ',passed' : ''}`, 'and Completed once');
            expect_equal(platform.faults.join('\n'), '', 'rules');
        }
    },
    async a_learners_language_is_found_in_the_list_of_the_platform() {
        for (const [list, code] of [['de-DE', 'de'], ['de-DE,en', 'de'], ['fr, DE', 'de'], ['en-US,de', 'en'], ['den', ''], ['', ''], [undefined, '']])
            expect_equal(preferred_language(list, ['en', 'de']), code, String(list));
        const platform = new Cmi5Platform('https://platform.example.org'), browser = cmi5_browser(platform);
        platform.documents.set('cmi5LearnerPreferences', '{"languagePreference":"de-DE,en","audioPreference":"on"}');
        const kept = new KeptCourse('first', ['look'], 'Ada', platform_of('cmi5', '', browser), browser), said = [];
        kept.platform.on_language = (list) => Boolean(said.push(list));
        await kept.begin();
        expect_equal(`${said.join()} ${platform.verbs().join()}`, 'de-DE,en ', 'the page is loaded again before anything is told');
        kept.platform.on_language = () => false;
        await kept.hand_over();
        await kept.platform.end();
        expect_equal(platform.verbs().join(), 'initialized,terminated', 'or goes on');
        expect_equal(platform.faults.join('\n'), '', 'rules');
    },
    async looking_around_is_not_judged_then_or_later() {
        const platform = new Cmi5Platform('https://platform.example.org'), local = storage();
        let browser = cmi5_browser(platform, {local}), kept = await kept_course('cmi5', browser);
        attempt(kept, browser, true, 0.5);
        await kept.platform.end();
        const before = platform.documents.get('sonocase.module');
        platform.statements.length = 0;
        for (const mode of ['Browse', 'Review']) {
            platform.launchMode = mode;
            browser = cmi5_browser(platform, {local});
            kept = new KeptCourse('first', ['look'], 'Ada', platform_of('cmi5', '', browser), browser);
            const begun = kept.begin();
            browser.clock.ms += 60e3;
            attempt(kept, browser, true, 0.5);  // before it is known that nothing is judged
            kept.platform.attempted(scored(true), true);
            await begun;
            browser.clock.ms += 60e3;
            attempt(kept, browser, true, 1);
            kept.platform.attempted(scored(true), true);
            expect_equal(kept.state('look').attempts.length, 3, `${mode}: the page shows it`);
            await kept.platform.end();
            expect_equal(platform.verbs().join(), 'initialized,terminated', `${mode}: statements`);
            expect_equal(platform.documents.get('sonocase.module'), before, `${mode}: what the platform keeps`);
            platform.statements.length = 0;
        }
        platform.launchMode = 'Normal';
        kept = await kept_course('cmi5', cmi5_browser(platform, {local}));
        expect_equal(kept.state('look').attempts.length, 1, 'judged is what was done when it was judged');
        expect_equal(platform.faults.join('\n'), '', 'rules');
        for (const is_2004 of [false, true]) {
            for (const mode of ['browse', 'review']) {
                const of_platform = new Map(), here = storage(), name = is_2004 ? 'API_1484_11' : 'API', kind = is_2004 ? 'scorm2004' : 'scorm12';
                const api = scorm_api(is_2004, of_platform);
                api.values.set(is_2004 ? 'cmi.mode' : 'cmi.core.lesson_mode', mode);
                browser = browser_of({local: here, api: {[name]: api}});
                kept = await kept_course(kind, browser);
                attempt(kept, browser, true, 1);
                kept.platform.leave();
                expect_equal(of_platform.get('cmi.suspend_data') ?? '', '', `${mode}: nothing is handed over`);
                of_platform.delete(is_2004 ? 'cmi.mode' : 'cmi.core.lesson_mode');
                const next = scorm_api(is_2004, of_platform);
                kept = await kept_course(kind, browser_of({local: here, api: {[name]: next}}));
                expect_equal(kept.state('look').attempts.length, 0, `${mode}: nor judged later`);
                expect_equal([...api.faults, ...next.faults].join('\n'), '', kind);
            }
        }
    },
    async locks_that_are_refused_leave_the_lease() {
        const error = () => new DOMException('the request was denied', 'SecurityError');
        for (const [words, request] of [['rejects', async () => { throw error(); }], ['throws', () => { throw error(); }]]) {
            for (const local of [storage(), null]) {
                const said = [], browser = {...browser_of(), locks: {request}, local};
                hold_alone('course', () => said.push('mine'), () => said.push('other'), browser);
                await new Promise((done) => setTimeout(done, 0));
                expect_equal(said.join(), 'mine', words);
            }
        }
    },
    async one_tab_alone_has_the_course_with_locks_and_without() {
        const clock = {ms: 1.8e12, timers: []}, local = storage(), said = [];
        const leaves = [];
        const tab = (name) => {
            const browser = browser_of({local, clock});
            browser.window.addEventListener = (event, what) => { if (event === 'pagehide') leaves.push(what); };
            hold_alone('course', () => said.push(`${name} has it`), () => said.push(`${name} waits`), browser);
        };
        tab('first');
        tab('second');
        await pass_seconds(clock, 600);
        expect_equal(said.join(), 'first has it,second waits', 'a lease is renewed');
        clock.timers.splice(0, 1);  // the first tab is closed
        leaves[0]();
        await pass_seconds(clock, 3);
        expect_equal(said.join(), 'first has it,second waits,second has it', 'and goes over');
        // A tab that dies without a word loses its lease.
        tab('third');
        clock.timers.splice(0, 1);
        await pass_seconds(clock, 9);
        expect_equal(said.slice(3).join(), 'third waits,third has it', 'in seconds');
    },
});
