// SPDX-License-Identifier: Apache-2.0

// measure.mjs SITE CASE: the figures of docs/browser.md, for a published site: first picture over 10 Mbit/s and 40 ms
// from an empty and from a warm cache, times of a frame, memory.
import {site_server} from '../../../scripts/web-serve.mjs';
import {Browser} from './support.mjs';

const [site, name] = process.argv.slice(2);
let sent = 0;
const server = site_server(site, (request, response) => {
    const write = response.write, end = response.end;
    response.write = function (data, ...rest) { sent += data?.length ?? 0; return write.call(this, data, ...rest); };
    response.end = function (data, ...rest) { sent += data?.length ?? 0; return end.call(this, data, ...rest); };
    return false;
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));
const url = `http://127.0.0.1:${server.address().port}/?case=${name}`;
const browser = await Browser.start();
const page = await browser.page(1280, 720);
await page.open('about:blank');
await page.send('Network.emulateNetworkConditions', {offline: false, latency: 40, downloadThroughput: 10e6 / 8, uploadThroughput: 10e6 / 8});

async function first_picture(words) {
    sent = 0;
    const bytes_at = new Promise((done) => {
        const look = () => page.value('globalThis.sonoplay?.app.scan.frames > 0').then((good) => good ? done(sent) : setImmediate(look), () => setImmediate(look));
        look();
    });
    await page.open(url);
    await page.until('sonoplay.app.scan.frames > 0 && sonoplay.app.scan.values.missing === 0', 300);
    const ms = await page.value('performance.getEntriesByName("first-picture")[0]?.startTime ?? performance.now()');
    console.log(`${words}: ${(ms / 1000).toFixed(2)} s, ${(await bytes_at / 1e6).toFixed(2)} MB sent by then`);
}
await first_picture('first picture, empty cache');
await page.until('!sonoplay.app.arriving()', 300);
await page.value('navigator.serviceWorker.ready.then(() => true)');
await page.until('navigator.serviceWorker.controller');
await first_picture('first picture, warm cache');
const times = await page.value(`(() => {
    const {core, scan} = sonoplay.app;
    const out = {};
    for (const paper of [false, true]) {
        core.set_image({...core.values(), model_paper: paper, side: 512});
        const ms = [];
        for (let n = 0; n < 120; ++n) {
            core.calls.slide(0, n % 60 < 30 ? 1 : -1);
            const start = performance.now();
            core.calls.frame(1000 + n / 60);
            ms.push(performance.now() - start);
        }
        ms.sort((a, b) => a - b);
        out[paper ? 'paper' : 'physical'] = {fastest: ms[0], median: ms[60], slowest: ms[119]};
    }
    out.memory_mb = core.memory.buffer.byteLength / 1e6;
    return out;
})()`);
console.log(JSON.stringify(times));
await browser.stop();
server.closeAllConnections?.();
server.close();
