// SPDX-License-Identifier: Apache-2.0

// measure.mjs SITE CASE [BIN CASE_FILE SESSION]: the figures of docs/browser.md, for a published site: first picture over
// 10 Mbit/s and 40 ms from an empty and from a warm cache, pictures per second, times of a frame, memory; with BIN (a
// build's programs) frames of the session's poses beside the desktop's, in turns.
//   measure.mjs SITE CASE camera VIDEO.y4m   instead, what the camera costs while pictures are drawn as fast as they are shown;
// the video is that of marker_oracle
import {execFileSync} from 'node:child_process';
import {site_server} from '../../../scripts/web-serve.mjs';
import {Browser} from './support.mjs';

const [site, name, bin, case_file, session_file] = process.argv.slice(2), camera = bin === 'camera';
const kTurns = 24;
const kSlow = {offline: false, latency: 40, downloadThroughput: 10e6 / 8, uploadThroughput: 10e6 / 8};
const server = site_server(site, undefined, 11);  // sizes are those of the best compression
await new Promise((done) => server.listen(0, '127.0.0.1', done));
const base = `http://127.0.0.1:${server.address().port}/`;
// The server compresses at the first request: not part of a visit.
for (const file of ['', 'style.css', 'sonoplay.js', 'sonoplay.wasm', 'cases.json', 'worker.js'])
    await (await fetch(base + file, {headers: {'Accept-Encoding': 'br'}})).arrayBuffer();
const url = `${base}?case=${name}`;

// Bytes as they come over the link, with the time of the browser's clock.
function watch(page) {
    const received = [];
    let wall_minus_own;
    page.browser.listeners.add(({sessionId, method, params}) => {
        if (sessionId !== page.session) return;
        if (method === 'Network.requestWillBeSent') wall_minus_own = params.wallTime - params.timestamp;
        if (method === 'Network.dataReceived') received.push([params.timestamp, params.encodedDataLength]);
    });
    return (wall_s) => received.filter(([own]) => own + wall_minus_own <= wall_s).reduce((sum, [, bytes]) => sum + bytes, 0);
}
async function first_picture(page, words) {
    const bytes_until = watch(page);
    await page.open('about:blank');
    await page.send('Network.emulateNetworkConditions', kSlow);
    await page.open(url);
    await page.until('sonoplay.app.scan.complete', 300);
    const origin = await page.value('performance.timeOrigin');
    const at = async (mark) => {
        const ms = await page.value(`performance.getEntriesByName("${mark}")[0].startTime`);
        return `${(ms / 1000).toFixed(2)} s, ${(bytes_until((origin + ms) / 1000) / 1e6).toFixed(2)} MB`;
    };
    console.log(`${words}: ${await at('first-picture')}; with all its blocks ${await at('complete-picture')}`);
    for (const mark of ['program-here', 'case-arrived', 'case-open', 'exercise-chosen']) console.log(`    ${mark}: ${await at(mark)}`);
}
const sorted = (ms) => ms.sort((a, b) => a - b);

const browser = await Browser.start(...camera ? ['--use-fake-device-for-media-stream', `--use-file-for-fake-video-capture=${case_file}`] : []);
const page = await browser.page(1280, 720);
if (camera) {
    await browser.send('Browser.setPermission', {permission: {name: 'camera'}, setting: 'granted', origin: base, browserContextId: page.context});
    await page.open(url);
    await page.until('sonoplay.app.scan.complete && !sonoplay.app.arriving()', 300);
    for (const on of [false, true]) {
        if (on) {
            await page.click('camera');
            await page.until('sonoplay.app.scan.camera?.newest?.tools[0].status === "good"');
            await page.value('document.querySelector("#camera-room button").click()');
            await page.until('sonoplay.app.scan.camera.pictures > 150');  // compiled for speed
        }
        const {took, late, rates, frame_ms} = await page.value(`new Promise((done) => {
            const {scan} = sonoplay.app, {camera} = scan, from = [scan.frames, camera?.pictures], start = performance.now(), took = [], late = [], frame_ms = [];
            if (camera) {
                const answered = camera.answered;
                camera.answered = (data) => { took.push(data.took_ms); late.push(data.at_ms - data.taken_ms); answered.call(camera, data); };
            }
            const step = () => {
                scan.touched();
                frame_ms.push(scan.frame_ms);
                const seconds = (performance.now() - start) / 1000;
                if (seconds < 10) requestAnimationFrame(step);
                else done({took, late, frame_ms, rates: [scan.frames, camera?.pictures].map((now, n) => (now - from[n]) / seconds)});
            };
            step();
        })`);
        // The fastest tenth too: others may use the machine.
        const part = (ms, of) => [...ms].sort((a, b) => a - b)[Math.floor(of * ms.length)]?.toFixed(1);
        const said = (ms) => `median ${part(ms, 0.5)} ms, a tenth within ${part(ms, 0.1)} ms`;
        console.log(`camera ${on ? 'on' : 'off'}: ${rates[0].toFixed(1)} pictures of the ultrasound a second, each ${said(frame_ms)}`);
        if (on) console.log(`    ${rates[1].toFixed(1)} of the camera, each ${said(took)}; poses come after ${said(late)}`);
    }
    await browser.stop();
    server.closeAllConnections?.();
    server.close();
    process.exit();
}
await first_picture(page, 'first picture, empty cache');
await page.send('Network.emulateNetworkConditions', {offline: false, latency: 0, downloadThroughput: -1, uploadThroughput: -1});
await page.until('!sonoplay.app.arriving() && navigator.serviceWorker.controller', 300);
await first_picture(page, 'first picture, warm cache');
await page.until('!sonoplay.app.arriving()', 300);
// Pictures per second while the probe moves, panels and all.
const rate = await page.value(`new Promise((done) => {
    const {core, scan} = sonoplay.app, from = scan.frames, start = performance.now();
    const step = () => {
        core.calls.slide(0, Math.sin(performance.now() / 300));
        scan.touched();
        const seconds = (performance.now() - start) / 1000;
        if (seconds < 5) requestAnimationFrame(step);
        else done({width: scan.values.width, height: scan.values.height, pictures_per_s: (scan.frames - from) / seconds, frame_ms: scan.frame_ms});
    };
    step();
})`);
console.log(`1280 x 720: ${rate.pictures_per_s.toFixed(1)} pictures per second of ${rate.width} x ${rate.height}`);
for (const paper of [false, true]) {
    const ms = sorted(await page.value(`(() => {
        const {core} = sonoplay.app, ms = [];
        core.set_image({...core.values(), model_paper: ${paper}, width: 512, height: 512});
        for (let n = 0; n < 120; ++n) {
            core.calls.slide(0, n % 60 < 30 ? 1 : -1);
            const start = performance.now();
            core.calls.frame(1000 + n / 60);
            ms.push(performance.now() - start);
        }
        return ms;
    })()`));
    console.log(`${paper ? 'paper' : 'physical'} 512 x 512: fastest ${ms[0].toFixed(2)}, median ${ms[60].toFixed(2)}, slowest ${ms[119].toFixed(2)} ms`);
}
const depths = sorted(await page.value(`Array.from({length: 15}, (unused, n) => {
    const {core} = sonoplay.app, start = performance.now();
    core.set_image({...core.values(), model_paper: false, depth_mm: n % 2 ? 120 : 150});
    return performance.now() - start;
})`));
console.log(`change of depth: median ${depths[7].toFixed(0)} ms`);
console.log(`memory of the program: ${(await page.value('sonoplay.app.core.memory.buffer.byteLength') / 1e6).toFixed(0)} MB; `
    + `of scripts: ${(await page.value('performance.memory?.usedJSHeapSize ?? NaN') / 1e6).toFixed(0)} MB`);

// The same poses here and there, 24 times in turns; the fastest of each pose counts, as others may use the machine and the
// browser compiles what runs often anew in the first turns.
if (bin) {
    const oracle = (...args) => JSON.parse(execFileSync(`${bin}/web_oracle`, args, {encoding: 'utf8', maxBuffer: 1 << 28}));
    for (const simd of ['', 'AVX2']) {
        const best = {page: [], desktop: []};
        const keep = (to, ms) => ms.forEach((x, n) => { to[n] = Math.min(to[n] ?? Infinity, x); });
        for (let turn = 0; turn < kTurns; ++turn) {
            const frames = oracle('times', case_file, session_file, 'physical', '512', ...(simd ? [simd] : []));
            keep(best.desktop, frames.map((frame) => frame.ms));
            keep(best.page, await page.value(`(() => {
                const {core, scan} = sonoplay.app;
                scan.hide();
                core.choose_exercise(0, 512);
                return ${JSON.stringify(frames)}.map(({time_s, probe, needle, has_needle}) => {
                    core.put_tools(time_s, probe, has_needle ? needle : null);
                    const start = performance.now();
                    core.calls.frame(time_s);
                    return performance.now() - start;
                });
            })()`));
        }
        const median = (ms) => sorted([...ms])[ms.length >> 1];
        console.log(`physical, ${best.page.length} poses: page ${median(best.page).toFixed(2)} ms, desktop ${simd || 'best'} `
            + `${median(best.desktop).toFixed(2)} ms, ratio ${(median(best.page) / median(best.desktop)).toFixed(2)}`);
    }
}
await browser.stop();
server.closeAllConnections?.();
server.close();
