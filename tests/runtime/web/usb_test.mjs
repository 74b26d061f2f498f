// SPDX-License-Identifier: Apache-2.0

// usb_test.mjs PROGRAM_FOLDER BIN_FOLDER: the page's trackers on USB in Chromium, whose navigator.usb is played by a stand-in
// with two devices: a Viper, which streams, and a driveBAY, which is asked for each pose.
import {join} from 'node:path';
import {site_server} from '../../../scripts/web-serve.mjs';
import {Browser, expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin] = process.argv.slice(2);
const work = folder(), case_file = join(work, 'small.sonocase'), session_file = join(work, 'small.igs.mha'), site = join(work, 'site');
run(join(bin, 'core_write_case'), case_file, session_file, 'flow');
run(join(bin, 'sonocase'), 'publish', case_file, '-o', site, '--program', program);
const server = site_server(site);
await new Promise((done) => server.listen(0, '127.0.0.1', done));
const url = `http://127.0.0.1:${server.address().port}/`;
const browser = await Browser.start('--enable-unsafe-swiftshader');
const kRoom = 'document.getElementById("usb-room").innerText', kNotice = 'document.getElementById("bar-notice").textContent';
const kFiles = /\/(usb|camera)\w*\.(js|wasm)$/;

// Runs in the page before its script. A device answers transferIn() with what it sends, one transfer at a time.
function stand_in() {
    const crc16 = (bytes) => {
        let crc = 0;
        for (const byte of bytes) {
            crc ^= byte;
            for (let bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1;
        }
        return crc;
    };
    const u32 = (...values) => [...new Uint8Array(Uint32Array.from(values).buffer)], f32 = (...values) => [...new Uint8Array(Float32Array.from(values).buffer)];
    class Device {
        constructor(vendorId, productId, endpoint_in) {
            Object.assign(this, {vendorId, productId, endpoint_in, opened: false, configuration: null, sent: [], asked: [], log: []});
        }
        async open() {
            if (this.denied) throw new DOMException('Access denied.', 'SecurityError');
            this.opened = true;
        }
        async close() { this.opened = false; this.drop('AbortError'); }
        async selectConfiguration() {
            const endpoint = (endpointNumber, direction) => ({endpointNumber, direction, type: 'bulk', packetSize: 64});
            this.configuration = {interfaces: [{interfaceNumber: 0, alternate: {endpoints: [endpoint(this.endpoint_in, 'in'), endpoint(2, 'out')]}}]};
        }
        async claimInterface() { if (this.busy) throw new DOMException('Unable to claim interface.', 'NetworkError'); }
        async clearHalt(direction, endpoint) { this.log.push(`clear ${direction} ${endpoint}`); }
        drop(name) { for (const [, failed] of this.asked.splice(0)) failed(new DOMException('gone', name)); }
        transferIn(endpoint, size) {
            if (this.gone || endpoint !== this.endpoint_in || size % 64) return Promise.reject(new DOMException('transfer', 'NetworkError'));
            return new Promise((done, failed) => { this.asked.push([done, failed]); this.deliver(); });
        }
        send(bytes) { this.sent.push(bytes); this.deliver(); }
        deliver() {
            while (this.sent.length && this.asked.length) {
                const bytes = this.sent.shift(), [done] = this.asked.shift();
                done(bytes === 'stall' ? {status: 'stall', data: null} : {status: 'ok', data: new DataView(Uint8Array.from(bytes).buffer)});
            }
        }
        async transferOut(endpoint, bytes) {
            if (this.gone || endpoint !== 2) throw new DOMException('transfer', 'NetworkError');
            if (bytes.length) this.hear(Uint8Array.from(bytes));
            return {status: 'ok', bytesWritten: bytes.length};
        }
        unplug() {
            clearInterval(this.beat);
            this.gone = true;
            this.opened = false;
            fake.plugged.delete(this);
            this.drop('NetworkError');
            fake.dispatchEvent(Object.assign(new Event('disconnect'), {device: this}));
        }
    }
    class Viper extends Device {
        constructor() { super(0x0F44, 0xBF01, 1); this.frame = 0; }
        frame_of(preamble, body) {
            const bytes = [...preamble].map((letter) => letter.charCodeAt(0)).concat(u32(body.length + 4), body);
            return bytes.concat(u32(crc16(bytes)));
        }
        hear(bytes) {
            const [, command, action] = new Uint32Array(bytes.slice(8, 20).buffer);
            this.log.push(`${command} ${action}`);
            if (command === 19) {
                clearInterval(this.beat);
                if (action === 0) this.beat = setInterval(() => this.measure(), 10);
            }
            const payload = command === 20 ? [...'VIPER 4 SN 1234'.padEnd(64 + 4 * 32, '\0')].map((letter) => letter.charCodeAt(0)) : [];
            this.send(this.frame_of('VPRC', u32(0, command, 3, 0, 0).concat(payload)));
        }
        // Both sensors move along x, 80 mm apart; centimetres.
        measure() {
            if (this.silent) return;
            if (this.stalls) { this.stalls = false; this.send('stall'); }
            const n = this.frame++, x = 10 + Math.sin(n / 50);
            const sensor = (k, y) => u32(k | 2 << 8 | 2 << 10 | (this.distorted ? 200 << 14 : 0)).concat(f32(x, y, 20, 1, 0, 0, 0));
            const bytes = this.frame_of('VPRP', u32(0, n, 0, 2).concat(sensor(0, 0), sensor(1, 8)));
            for (let at = 0; at < bytes.length; at += 48) this.send(bytes.slice(at, at + 48));
        }
    }
    class DriveBay extends Device {
        constructor() { super(0x21E2, 0x1008, 6); this.asks = 0; }
        hear(bytes) {
            const [a, b, c] = bytes;
            this.log.push([...bytes].map((byte) => byte.toString(16)).join(' '));
            const sensor = a - 0xF1;
            if (a === 0x4F) this.send(b === 3 ? [0, 0] : [0]);
            else if (b === 0x4F) this.send(c === 0x1B || sensor < 2 ? [7, 1] : [0, 0]);
            else if (b === 0x42) {  // position x, y, z and three angles of zero
                ++this.asks;
                const word = (mm) => { const v = Math.round(mm / 25.4 * 32768 / 36 / 4) & 0x3FFF; return [v & 0x7F, v >> 7 & 0x7F]; };
                const record = [...word(100 + Math.sin(this.asks / 100)), ...word(80 * sensor), ...word(200), 0, 0, 0, 0, 0, 0];
                record[0] |= 0x80;
                this.send(record);
            }
        }
    }
    const fake = Object.assign(new EventTarget(), {
        plugged: new Set(), makers: {Viper, DriveBay}, filters: null, choice: null,
        plug(name) {
            const device = new fake.makers[name]();
            fake.plugged.add(device);
            fake.dispatchEvent(Object.assign(new Event('connect'), {device}));
            return device;
        },
        async requestDevice({filters}) {
            fake.filters = filters;
            const device = [...fake.plugged].find(({vendorId, productId}) => filters.some((one) => one.vendorId === vendorId && one.productId === productId));
            if (!device) throw new DOMException('No device selected.', 'NotFoundError');
            return device;
        },
    });
    Object.defineProperty(navigator, 'usb', {value: fake, configurable: true});
}

async function scanning(query = '', setup = '') {
    const page = await browser.page();
    await page.send('Page.addScriptToEvaluateOnNewDocument', {source: `(${stand_in})();${setup}`});
    await page.open(`${url}?case=small${query}`);
    await page.until('sonoplay.app.scan.frames > 0 && !sonoplay.app.arriving()');
    return page;
}
const place = (page) => page.value('[...document.querySelectorAll("#usb-room button")][0].click()');
const distance = (a, b) => Math.hypot(...[3, 7, 11].map((n) => a[n] - b[n]));
const watch = (page) => page.value(`(() => {
    const {core} = sonoplay.app, put = core.put_tools;
    globalThis.taken = [];
    core.put_tools = (...all) => { taken.push(all.slice(1)); put.apply(core, all); };
})()`);

await run_tests({
    async nothing_of_it_is_fetched_until_it_is_chosen_and_then_it_moves_the_picture() {
        const page = await scanning('&exercise=scan', 'globalThis.device = navigator.usb.plug("Viper");');
        expect_equal(page.requests.filter((one) => kFiles.test(one)).join(), '', 'before');
        const before = await page.value('sonoplay.app.core.probe_home()');
        await page.click('usb');
        await page.until(`${kRoom}.includes('Polhemus Viper (VIPER 4 SN 1234)') && ${kRoom}.includes('Good')`);
        expect_equal(page.requests.filter((one) => kFiles.test(one)).map((one) => one.slice(url.length)).sort().join(), 'usb.js,usb.wasm', 'after');
        expect_equal(await page.value('navigator.usb.filters.some(({vendorId, productId}) => vendorId === 0x0F44 && productId === 0xBF01)'), true, 'the browser is told which devices');
        expect((await page.value(kRoom)).includes('Hold the probe where the exercise begins'), 'asks for the place');
        expect_equal(await page.value('sonoplay.app.scan.values.has_needle'), 0, 'nothing moves until then');
        await watch(page);
        await place(page);
        await page.until('taken.length > 30 && sonoplay.app.scan.values.has_needle');
        const taken = await page.value('taken');
        for (const [probe, needle, states, tracker] of taken) {
            expect_equal(`${tracker} ${states}`, 'usb good,good', 'tracker');
            expect(Math.abs(distance(probe, needle) - 80) < 1e-3, `the needle is ${distance(probe, needle)} mm from the probe`);
            expect(distance(probe, before) < 20.1, `the probe is ${distance(probe, before)} mm from where it was placed`);
        }
        const ways = taken.map(([probe]) => distance(probe, before));
        expect(Math.max(...ways) - Math.min(...ways) > 1, 'it moves');
        await page.until(`/\\b(9\\d|1[01]\\d|[5-8]\\d) Hz/.test(${kRoom})`);  // a busy machine's timers are late
        await page.value('sonoplay.app.core.start_attempt("", "2026-01-31T12:00:00Z", performance.now() / 1000)');
        await page.until('taken.length > 60');
        const recording = await page.value('new TextDecoder("latin1").decode(sonoplay.app.core.finish_attempt().recording.slice(0, 4000))');
        expect(/SonocaseAttempt = .*\btracker=usb\b/.test(recording), `the recording names it: ${recording.slice(0, 1500)}`);
        await page.value('device.distorted = true');
        await page.until(`${kRoom}.includes('Poor')`);
        await page.value('device.stalls = true; taken.length = 0');
        await page.until('device.log.includes("clear in 1") && taken.length > 20');
        await page.click('usb');
        await page.until('device.log.at(-1) === "19 2" && !device.opened');  // it rests, and others may have it
        expect_equal(await page.value(kRoom), '', 'switched off');
        expect_equal(page.errors.join(), '', 'errors on the console');
        expect(page.requests.every((one) => one.startsWith(url) || one.startsWith('data:') || one.startsWith('blob:')), `nothing is asked of others: ${page.requests}`);
        await page.click('usb');
        await page.until(`${kRoom}.includes('Poor')`);
        await page.close();
    },
    async one_that_is_asked_for_each_pose_does_so_too() {
        const page = await scanning('&exercise=scan', 'globalThis.device = navigator.usb.plug("DriveBay");');
        await page.click('usb');
        await page.until(`${kRoom}.includes('driveBAY') && ${kRoom}.includes('Good')`);
        await watch(page);
        await place(page);
        await page.until('taken.length > 30');
        const steps_mm = 4 * 36 * 25.4 / 32768;  // of its numbers
        for (const [probe, needle] of await page.value('taken'))
            expect(Math.abs(distance(probe, needle) - 80) < 2 * steps_mm, `the needle is ${distance(probe, needle)} mm from the probe`);
        await page.close();
    },
    async a_calibration_is_used_or_refused() {
        const page = await scanning('&exercise=scan', 'navigator.usb.plug("Viper");');
        await page.click('usb');
        await page.until(`${kRoom}.includes('Good')`);
        await page.value(`sonoplay.app.scan.usb.use_file(new File(['{}'], 'probe.json'))`);
        await page.until(`${kRoom}.includes('probe.json')`);
        const calibration = JSON.stringify({format: 'sonocase calibration', version: 1, kind: 'mannequin', sensor: '', sensor_from_tool: {rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [50, 0, 0]},
            scale: 1, rms_mm: 0.5, sigma_mm: [0.1, 0.1, 0.1], condition: 3, poses: 20, date: '2026-01-31T12:00:00Z'});
        await page.value(`sonoplay.app.scan.usb.use_file(new File([${JSON.stringify(calibration)}], 'mannequin.json'))`);
        await page.until(`!${kRoom}.includes('probe.json') && !${kRoom}.includes('Hold the probe')`);  // nothing is left to be placed
        await watch(page);
        await page.until('taken.length > 3');
        await page.close();
    },
    async what_is_missing_has_a_sentence_in_both_languages() {
        const kMissing = [
            ['', 'No tracker was chosen', 'Es wurde kein Tracker gewählt'],
            ['Object.defineProperty(navigator, "usb", {value: undefined, configurable: true});', 'This browser has no USB', 'Dieser Browser hat kein USB'],
            ['delete WebAssembly.Suspending;', 'too old for a tracker on USB', 'zu alt für einen Tracker an USB'],
        ];
        for (const [setup, english, german] of kMissing)
            for (const [query, words] of [['', english], ['&lang=de', german]]) {
                const page = await scanning(query, setup);
                await page.click('usb');
                await page.until(`${kNotice}.includes(${JSON.stringify(words)})`);
                expect_equal(await page.value('document.getElementById("usb").getAttribute("aria-pressed")'), 'false', 'it is off');
                await page.until('sonoplay.app.scan.frames > 5');
                await page.close();
            }
    },
    async one_in_use_or_not_allowed_says_so_and_begins_once_it_may() {
        for (const [setup, english, german] of [['busy', 'Polhemus Viper is in use by another program', 'ist von einem anderen Programm belegt'],
            ['denied', 'This computer does not let the browser use the Polhemus Viper', 'Dieser Rechner lässt den Browser den Polhemus Viper nicht benutzen']])
            for (const [query, words] of [['', english], ['&lang=de', german]]) {
                const page = await scanning(query, `globalThis.device = navigator.usb.plug("Viper"); device.${setup} = true;`);
                await page.click('usb');
                await page.until(`[${kRoom}, ${kNotice}].every((words) => words.includes(${JSON.stringify(words)}))`);
                await page.value(`device.${setup} = false`);
                await page.until(`${kNotice} === '' && /Good|Gut/.test(${kRoom})`);
                await page.close();
            }
    },
    async one_that_is_unplugged_is_said_and_goes_on_when_it_is_back() {
        const page = await scanning('&exercise=scan', 'globalThis.device = navigator.usb.plug("Viper");');
        await page.click('usb');
        await page.until(`${kRoom}.includes('Good')`);
        await place(page);
        await page.until('sonoplay.app.scan.values.has_needle');
        await page.value('device.unplug()');
        await page.until(`[${kRoom}, ${kNotice}].every((words) => words.includes('The tracker was unplugged; plug it in again.')) && !${kRoom}.includes('Good')`);
        await page.until('!sonoplay.app.scan.values.has_needle', 10);  // its pose is too old
        await page.value('globalThis.device = navigator.usb.plug("Viper"); 0');
        await page.until(`${kRoom}.includes('Good') && ${kNotice} === '' && sonoplay.app.scan.values.has_needle`);
        await page.value('device.silent = true');
        await page.until(`${kRoom}.includes('No reading comes')`);
        await page.value('device.silent = false');
        await page.until(`${kRoom}.includes('Good')`);
        await page.close();
    },
    async camera_and_tracker_take_turns() {
        const page = await scanning('', 'navigator.usb.plug("Viper");');
        await page.click('usb');
        await page.until(`${kRoom}.includes('Good')`);
        await page.click('camera');
        await page.until('sonoplay.app.scan.usb === null');
        expect_equal(await page.value(kRoom), '', 'the first is off');
        await page.close();
    },
});
server.closeAllConnections?.();
await new Promise((done) => server.close(done));
await browser.stop();
