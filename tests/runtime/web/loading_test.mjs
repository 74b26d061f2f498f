// SPDX-License-Identifier: Apache-2.0

// loading_test.mjs PROGRAM_FOLDER BIN_FOLDER: a case over the network, in Chromium: a picture before the case is whole,
// servers and connections that fail, damaged parts, browsers that lack something, two tabs, a tab that slept.
import {cpSync, readFileSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {site_server} from '../../../scripts/web-serve.mjs';
import {Browser, cook_draft, expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin] = process.argv.slice(2);
const {Core} = await import(pathToFileURL(join(new URL('.', import.meta.url).pathname, '../../../runtime/web/page/core.js')));
const work = folder(), case_file = join(work, 'demo.sonocase'), site = join(work, 'site');
cook_draft(bin, case_file);
run(join(bin, 'sonocase'), 'publish', case_file, '-o', site, '--program', program);
const [entry] = JSON.parse(readFileSync(join(site, 'cases.json'))).cases;
const file_bytes = readFileSync(join(site, entry.file));
const first_end = entry.first[0][0] + entry.first[0][1];
const kFrames = 'sonoplay.app.scan.frames', kLeft = 'sonoplay.app.scan.values.segments_left';
const notice = 'document.getElementById("notice").textContent', arriving = 'document.getElementById("arriving").textContent';

// A server with a fault: fault(range, request, response) of requests for the case, range null for the whole file; true
// where it has answered.
async function serve(fault = () => false) {
    const server = site_server(site, (request, response) => {
        if (!request.url.endsWith('.sonocase')) return false;
        const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? '');
        return fault(range && [Number(range[1]), Number(range[2])], request, response);
    });
    await new Promise((done) => server.listen(0, '127.0.0.1', done));
    return {url: `http://127.0.0.1:${server.address().port}/`, stop: () => { server.closeAllConnections?.(); server.close(); }};
}
function send_part(response, [from, to], change = (bytes) => bytes, total = file_bytes.length) {
    const bytes = change(Buffer.from(file_bytes.subarray(from, to + 1)));
    response.writeHead(206, {'Content-Range': `bytes ${from}-${to}/${total}`, 'Content-Length': bytes.length}).end(bytes);
    return true;
}
function altered(bytes) {
    bytes[bytes.length >> 1] ^= 1;
    return bytes;
}
// Not of what the case is opened with.
const is_late = (range) => range && !entry.first.some(([at, bytes]) => range[0] < at + bytes && range[1] >= at);

const browser = await Browser.start();
// with_page(fault, work): a page of its own on a server with the fault. before: a script that runs before the page's.
async function with_page(fault, visit, {before = '', query = '?case=demo', goes_on = false} = {}) {
    const server = await serve(fault), page = await browser.page();
    try {
        if (before) {
            await page.send('Page.enable');
            await page.send('Page.addScriptToEvaluateOnNewDocument', {source: before});
        }
        await page.open(server.url + query);
        await visit(page, server);
        if (!goes_on) expect_equal(page.errors.filter((one) => /exception|Uncaught/i.test(one)).join(), '', 'exceptions');
    } finally {
        await page.close();
        server.stop();
    }
}
async function whole(page) {
    await page.until(`${kFrames} > 0 && !sonoplay.app.arriving() && ${kLeft} === 0`);
    await page.value('sonoplay.app.arriving_case.whole');  // and kept
}

// A copy of the site that a test may change, on a server of its own. answer(request, response): true where it has answered;
// headers(url): more of them.
async function with_site(visit, {answer = () => false, headers = () => ({}), before = ''} = {}) {
    const its = folder();
    cpSync(site, its, {recursive: true});
    const server = site_server(its, (request, response) => {
        const write = response.writeHead.bind(response);
        response.writeHead = (status, given) => write(status, {...given, ...headers(request.url)});
        return answer(request, response);
    });
    await new Promise((done) => server.listen(0, '127.0.0.1', done));
    const stop = () => { server.closeAllConnections?.(); server.close(); };
    const page = await browser.page(), url = `http://127.0.0.1:${server.address().port}/`;
    try {
        if (before) {
            await page.send('Page.enable');
            await page.send('Page.addScriptToEvaluateOnNewDocument', {source: before});
        }
        await visit(page, {url, its, stop, offline: async () => {
            stop();
            await page.send('Network.emulateNetworkConditions', {offline: true, latency: 0, downloadThroughput: -1, uploadThroughput: -1});
        }});
    } finally {
        await page.close();
        stop();
    }
}
// Once the page works offline.
async function worker_is_ready(page) {
    await page.value('navigator.serviceWorker.ready.then(() => true)');
    await page.until('navigator.serviceWorker.controller');
}

// The page's pictures of three poses are those of the whole case in node, by their digests.
const kPose = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 120, 0, 0, 0, 1], kPoses = [0, 10, 25].map((y) => kPose.with(7, y).with(11, 100));
const digest_of = async (pixels) => Buffer.from(await crypto.subtle.digest('SHA-256', pixels)).toString('hex');
async function draw_in_node() {
    const core = await Core.create(await WebAssembly.compile(readFileSync(join(program, 'sonoplay.wasm'))));
    core.reserve(file_bytes.length);
    core.put(file_bytes, 0);
    core.open('demo');
    core.choose_exercise(0, 256);
    const pictures = kPoses.map((pose, n) => {
        core.put_tools(n, pose, null);
        core.calls.frame(n);
        return core.pixels().slice();
    });
    expect(pictures.some((pixels) => pixels.some((grey) => grey > 60)), 'the poses show something');
    return Promise.all(pictures.map(digest_of));
}
let wanted;  // of all tests
async function expect_right_pixels(page) {
    wanted ??= await draw_in_node();
    const is = await page.value(`(async () => {
        const {core, scan} = sonoplay.app, pictures = [];
        scan.hide();
        core.choose_exercise(0, 256);
        for (const [n, pose] of ${JSON.stringify(kPoses)}.entries()) {
            core.put_tools(n, pose, null);
            core.calls.frame(n);
            pictures.push(core.pixels().slice());
        }
        const hex = (bytes) => [...new Uint8Array(bytes)].map((byte) => byte.toString(16).padStart(2, '0')).join('');
        return Promise.all(pictures.map(async (pixels) => hex(await crypto.subtle.digest('SHA-256', pixels))));
    })()`);
    expect_equal(is.join(), wanted.join(), 'pictures');
}

await run_tests({
    async a_picture_comes_before_the_case_is_whole_and_the_rest_behind() {
        const held = [];
        await with_page((range, request, response) => {
            if (!is_late(range) || !held.open) {
                if (is_late(range)) held.push(() => send_part(response, range));
                return is_late(range);
            }
            return false;
        }, async (page) => {
            await page.until(`${kFrames} > 2 && sonoplay.app.scan.values.missing > 0`);
            expect(await page.value('sonoplay.frame().pixels.some((grey) => grey > 100)'), 'there is a picture');
            expect(await page.value(`${arriving}.includes('less structure')`), 'and it says what it lacks');
            const left = await page.value(kLeft);
            held.open = true;
            held.forEach((send) => send());
            await whole(page);
            expect(left > entry.bytes / entry.segment_bytes / 2, 'most of it came later');
            expect_equal(await page.value(arriving), '', 'words at the end');
            await expect_right_pixels(page);
        });
    },
    async attempts_that_draw_targets_and_all_scores_wait_for_the_whole_case() {
        const held = [];
        await with_page((range, request, response) => {
            if (!is_late(range) || held.open) return false;
            held.push(() => send_part(response, range));
            return true;
        }, async (page) => {
            await page.until(`${kFrames} > 0`);
            await page.key('KeyB');
            await page.until('document.getElementById("wait").open');
            await page.click('wait-back');
            await page.until('!document.getElementById("wait").open');
            expect_equal(await page.value('sonoplay.app.scan.values.attempt'), 0, 'no attempt without its targets');
            // As an exercise whose targets stay where they are written.
            await page.value('sonoplay.app.description.exercises[sonoplay.app.exercise].drawn = false');
            await page.key('KeyB');
            await page.until('sonoplay.app.scan.values.seconds > 5.1');
            await page.key('KeyB');
            await page.until('document.getElementById("wait").open');
            const seconds = await page.value('sonoplay.app.scan.values.seconds');
            await page.click('wait-back');
            await page.until(`!document.getElementById("wait").open && sonoplay.app.scan.values.seconds > ${seconds}`);
            await page.key('KeyB');
            await page.until('document.getElementById("wait").open');
            held.open = true;
            held.forEach((send) => send());
            await page.until('!document.getElementById("after").hidden');
        });
    },
    async the_next_visit_needs_no_part_from_the_network() {
        let asked = 0;
        await with_page((range) => { asked += 1; return false; }, async (page, {url}) => {
            await whole(page);
            const first_visit = asked;
            await page.open(`${url}?case=demo`);
            await whole(page);
            expect(first_visit > 1, 'parts were asked for');
            expect_equal(asked, first_visit, 'requests');
            await expect_right_pixels(page);
        });
    },
    async a_server_without_ranges_is_streamed() {
        await with_page((range, request, response) => {
            response.writeHead(200, {'Content-Length': file_bytes.length});
            // The first part, and the rest once the page has shown it.
            response.write(file_bytes.subarray(0, first_end + entry.first.at(-1)[1]));
            setImmediate(() => response.end(file_bytes.subarray(first_end + entry.first.at(-1)[1])));
            return true;
        }, async (page) => {
            await whole(page);
            await expect_right_pixels(page);
        });
    },
    async wrong_lengths_are_said() {
        for (const [words, fault] of [
            ['another length', (range, request, response) => send_part(response, range, undefined, file_bytes.length + 1)],
            ['cut short', (range, request, response) => { response.writeHead(200).end(file_bytes.subarray(0, 9000)); return true; }],
            ['longer', (range, request, response) => { response.writeHead(200).end(Buffer.concat([file_bytes, Buffer.alloc(9000)])); return true; }]]) {
            await with_page(fault, (page) => page.until(`(${notice} + ${arriving}).includes(${JSON.stringify(words)})`), {goes_on: true});
        }
    },
    async parts_of_another_place_than_asked_for_are_not_taken() {
        // A server that shifts ranges: the whole file is asked for instead.
        await with_page((range, request, response) => range ? send_part(response, [range[0] + 1, range[1] + 1]) : false,
            async (page) => { await whole(page); await expect_right_pixels(page); });
    },
    async an_altered_segment_is_fetched_again() {
        const bad = new Set();
        await with_page((range, request, response) => {
            const segment = range && Math.floor((range[0] + (range[1] - range[0] + 1 >> 1)) / entry.segment_bytes);
            if (!range || bad.size >= 3 || bad.has(segment)) return false;
            bad.add(segment);
            return send_part(response, range, altered);
        }, async (page) => {
            await whole(page);
            expect(bad.size >= 2, 'some were altered');
            await expect_right_pixels(page);
        });
    },
    async a_segment_that_stays_altered_is_refused_and_the_picture_goes_on() {
        await with_page((range, request, response) => is_late(range) && send_part(response, range, altered), async (page) => {
            await page.until(`${kFrames} > 0 && ${arriving}.includes('damaged')`);
            await page.until(`${kFrames} > ${await page.value(kFrames)} + 2`);
            expect(await page.value('sonoplay.frame().pixels.some((grey) => grey > 100)'), 'there is a picture');
        });
        await with_page((range, request, response) => range && send_part(response, range, altered),
            (page) => page.until(`${notice}.includes('damaged')`), {goes_on: true});
    },
    async a_connection_that_breaks_in_the_middle_of_a_scan() {
        const state = {broken: true};
        await with_page((range, request, response) => {
            if (!is_late(range) || !state.broken) return false;
            // Some bytes, then the end.
            response.writeHead(206, {'Content-Range': `bytes ${range[0]}-${range[1]}/${file_bytes.length}`, 'Content-Length': range[1] - range[0] + 1});
            response.write(file_bytes.subarray(range[0], range[0] + 5000), () => response.destroy());
            return true;
        }, async (page) => {
            await page.until(`${kFrames} > 0 && ${arriving}.includes('No connection')`);
            await page.until(`${kFrames} > ${await page.value(kFrames)} + 2`);
            expect(await page.value('sonoplay.frame().pixels.some((grey) => grey > 100)'), 'the picture goes on');
            state.broken = false;
            await page.value('dispatchEvent(new Event("online"))');
            await whole(page);
            await expect_right_pixels(page);
        });
    },
    async a_kept_part_that_was_cut_or_altered_is_fetched_again() {
        let asked = 0;
        await with_page(() => { ++asked; return false; }, async (page, {url}) => {
            await whole(page);
            await page.value(`(async () => {
                const cache = await caches.open('sonocase-cases-2');
                const groups = (await cache.keys()).filter((one) => one.url.includes('&group='));
                const bytes = async (key) => new Uint8Array(await (await cache.match(key)).arrayBuffer());
                const first = await bytes(groups[0]), last = await bytes(groups.at(-1));
                first[5000] ^= 1;
                await cache.put(groups[0], new Response(first));
                await cache.put(groups.at(-1), new Response(last.slice(0, 100)));
            })()`);
            const before = asked;
            await page.open(`${url}?case=demo`);
            await whole(page);
            expect(asked > before, 'what was wrong was asked for');
            await expect_right_pixels(page);
        });
    },
    async two_tabs_load_the_same_case() {
        const server = await serve(), a = await browser.page(), b = await browser.page(1280, 720, a.context);
        await Promise.all([a, b].map((page) => page.open(`${server.url}?case=demo`)));
        for (const page of [a, b]) {  // a tab behind another draws nothing
            await page.send('Page.bringToFront');
            await whole(page);
            await expect_right_pixels(page);
        }
        await a.close();
        await b.close();
        server.stop();
    },
    async without_storage_it_plays_and_says_that_nothing_is_kept() {
        const before = `Object.defineProperty(globalThis, 'caches', {value: undefined});
            Object.defineProperty(globalThis, 'indexedDB', {get() { throw new DOMException('no', 'SecurityError'); }});
            Object.defineProperty(globalThis, 'localStorage', {get() { throw new DOMException('no', 'SecurityError'); }});`;
        await with_page(undefined, async (page) => {
            await whole(page);
            await page.key('KeyB');
            await page.until('sonoplay.app.scan.values.seconds > 5.1');
            await page.key('KeyB');
            await page.until('document.getElementById("after-notice").textContent.includes("keeps nothing")');
        }, {before});
    },
    async without_simd_the_scalar_program_runs() {
        await with_page(undefined, async (page) => {
            await whole(page);
            await expect_right_pixels(page);
            expect(page.requests.some((one) => one.endsWith('sonoplay-scalar.wasm')), 'the scalar program');
        }, {before: 'WebAssembly.validate = () => false;'});
    },
    async after_one_visit_it_works_offline_with_or_without_simd_and_with_its_cards_pictures() {
        for (const before of ['', 'WebAssembly.validate = () => false;']) {
            await with_site(async (page, {url, offline}) => {
                await page.open(`${url}?case=demo`);
                await whole(page);
                await worker_is_ready(page);
                await offline();
                await page.open(`${url}?case=demo`);
                await whole(page);
                await page.value('sonoplay.app.to_cases()');
                await page.until('document.querySelector("#cases img").naturalWidth > 0');
            }, {before});
        }
    },
    async a_new_page_has_its_own_program_also_from_a_host_that_lets_browsers_keep_files() {
        await with_site(async (page, {url, its}) => {
            const title = 'document.getElementById("start-title").textContent';
            await page.open(url);
            await page.until('sonoplay.app.ready');
            await worker_is_ready(page);
            const change = (name, ...by) => writeFileSync(join(its, name), readFileSync(join(its, name), 'utf8').replaceAll(...by));
            change('index.html', 'Ultrasound cases', 'Newer cases');
            change('sonoplay.js', '// SPDX', 'globalThis.newer = true;\n// SPDX');
            change('worker.js', /(kCache = `.*?)[0-9a-f]{16}/g, '$1newer');
            await page.open(url);
            await page.until('caches.keys().then((names) => { globalThis.names = names; }) && names.some((one) => one.endsWith("newer")) && names.length === names.filter((one) => one.endsWith("newer") || one.startsWith("sonocase-cases")).length', 30);
            await page.open(url);
            await page.until(`sonoplay.app.ready && ${title} === 'Newer cases'`);
            expect_equal(await page.value('globalThis.newer ?? false'), true, 'its own script');
        }, {headers: (path) => /\.(js|css|wasm)$/.test(path) && !path.endsWith('worker.js') ? {'Cache-Control': 'public, max-age=600'} : {}});
    },
    async what_a_network_shows_in_place_of_the_list_is_not_kept() {
        let portal = false;
        const answer = (request, response) => {
            if (!portal || !request.url.startsWith('/cases.json')) return false;
            response.writeHead(200, {'Content-Type': 'text/html'}).end('<html>Please sign in</html>');
            return true;
        };
        await with_site(async (page, {url, offline}) => {
            await page.open(url);
            await page.until('sonoplay.app.ready');
            await worker_is_ready(page);
            portal = true;
            await page.open(url);
            await page.until('document.querySelectorAll("#cases li").length === 1');
            await offline();
            await page.open(url);
            await page.until('document.querySelectorAll("#cases li").length === 1');
        }, {answer});
    },
    async a_full_browser_opens_cases_from_the_network_and_lets_go_of_those_that_the_site_no_longer_has() {
        await with_site(async (page, {url}) => {
            await page.open(url);
            await page.until('sonoplay.app.ready');
            await worker_is_ready(page);
            const kept = `caches.open('sonocase-cases-2').then((cache) => cache.keys()).then((keys) => keys.map((one) => one.url.split('/').slice(3).join('/')).sort().join())`;
            await page.value(`caches.open('sonocase-cases-2').then((cache) => Promise.all(['gone-01234567.sonocase?digest=0&group=0', 'gone-01234567.sonocase.segments?digest=0', 'other/gone.sonocase?digest=0&group=0']
                .map((key) => cache.put(key, new Response('x')))))`);
            await page.open(url);
            await page.until('sonoplay.app.ready');
            await page.until(`(${kept}.then((is) => { globalThis.is = is; }), globalThis.is === 'other/gone.sonocase?digest=0&group=0')`, 10);
            const {usage} = await page.value('navigator.storage.estimate()');
            await page.send('Storage.overrideQuotaForOrigin', {origin: url.replace(/\/$/, ''), quotaSize: Math.max(1, usage - 1000)});
            await page.open(`${url}?case=demo`);
            await whole(page);
            await expect_right_pixels(page);
        });
    },
    async without_webgl_nothing_is_missing() {
        const before = `const get = HTMLCanvasElement.prototype.getContext;
            HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return /webgl/.test(kind) ? null : get.call(this, kind, ...rest); };`;
        await with_page(undefined, async (page) => { await whole(page); await expect_right_pixels(page); }, {before});
    },
    async without_webassembly_it_says_so() {
        await with_page(undefined, (page) => page.until(`${notice}.includes('no WebAssembly')`), {before: 'delete globalThis.WebAssembly;', goes_on: true});
    },
    async a_tab_that_slept_for_an_hour_goes_on_where_it_was() {
        await with_page(undefined, async (page) => {
            await whole(page);
            await page.key('ArrowUp', 0, 'down');
            await page.until(`${kFrames} > 5`);
            const moved = await page.value(`(() => {
                const {scan} = sonoplay.app, slide = scan.core.calls.slide, slid = [];
                scan.core.calls = {...scan.core.calls, slide: (x, y) => { slid.push(Math.hypot(x, y)); slide(x, y); }};
                scan.tick(performance.now() + 3600e3);
                return Math.max(0, ...slid);
            })()`);
            await page.key('ArrowUp', 0, 'up');
            expect(moved <= 5 + 1e-9, `a held key moved by ${moved} mm`);
            await page.until(`${kFrames} > ${await page.value(kFrames)} + 3`);
        });
    },
});
await browser.stop();
