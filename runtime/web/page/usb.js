// SPDX-License-Identifier: Apache-2.0

// An electromagnetic tracker at this computer's USB, by WebUSB. Fetched when it is chosen; the browser asks which device.
// Its protocol is the desktop's (program/usb_exports.cpp); here bytes go to and fro.
import {PlainError} from './core.js';
import {PlacedTracker} from './placed_tracker.js';
import {t} from './words.js';

const kState = ['absent', 'good', 'poor', 'lost'];
const kUsbToolValues = 17;  // usb_exports.cpp
const kUsbOutcome = {ok: 0, timeout: 1, stalled: 2, gone: 3, failed: 4};  // UsbOutcome of usb_pipe.h
const kOpened = {not_allowed: -1, in_use: -2, no_endpoints: -3, failed: -4};  // Opened of usb_exports.cpp
const kHealthMs = 500, kSilentMs = 500;
let before = Promise.resolve();  // the last one lets go of its device
const pause = (ms) => new Promise((done) => { setTimeout(done, ms); });

// One device of a WebUSB (navigator.usb, or a stand-in of it) as the program asks for it.
class UsbLink {
    constructor(device) { Object.assign(this, {device, coming: null, rest: new Uint8Array()}); }
    forget() {
        Object.assign(this, {coming: null, rest: new Uint8Array(), claimed: false});
        this.closing = this.device?.close().catch(() => {});
    }
    // Another one of the same kind is taken after it was unplugged: browsers give it another object.
    is_there() { return this.device !== null; }
    came(device) { if (!this.device && device.vendorId === this.vendor && device.productId === this.product) this.device = device; }
    went(device) { if (this.device === device) Object.assign(this, {vendor: device.vendorId, product: device.productId, device: null, claimed: false, coming: null, rest: new Uint8Array()}); }
    // Addresses of endpoints; 0: the first bulk ones. The size of packets, or one of kOpened.
    async open(endpoint_in, endpoint_out) {
        await this.closing;
        const {device} = this;
        if (!device) return kOpened.failed;
        try {
            if (device.opened) await device.close();
            await device.open();
            if (!device.configuration) await device.selectConfiguration(1);
        } catch (error) {
            return error.name === 'SecurityError' ? kOpened.not_allowed : kOpened.failed;
        }
        try {
            await device.claimInterface(0);
        } catch {
            return kOpened.in_use;
        }
        const of = device.configuration.interfaces.find((one) => one.interfaceNumber === 0)?.alternate.endpoints ?? [];
        const find = (direction, address) => of.find((one) => one.type === 'bulk' && one.direction === direction && (!address || one.endpointNumber === (address & 15)));
        const [from, to] = [find('in', endpoint_in) ?? find('in', 0), find('out', endpoint_out) ?? find('out', 0)];
        if (!from || !to) return kOpened.no_endpoints;
        Object.assign(this, {from: from.endpointNumber, to: to.endpointNumber, claimed: true});
        return to.packetSize;
    }
    // A transfer that failed: the device has gone, or not.
    failed() { return this.device ? kUsbOutcome.failed : kUsbOutcome.gone; }
    async ended_in(transfer, timeout_s) {
        const late = pause(1000 * timeout_s).then(() => null);
        return Promise.race([transfer, late]);
    }
    async write(bytes, timeout_s) {
        if (!this.claimed) return this.failed();
        try {
            const done = await this.ended_in(this.device.transferOut(this.to, bytes), timeout_s);
            if (!done) return kUsbOutcome.timeout;
            if (done.status === 'stall') return kUsbOutcome.stalled;
            return done.bytesWritten === bytes.length ? kUsbOutcome.ok : kUsbOutcome.failed;
        } catch {
            await pause(0);  // a browser says that it went after the transfer fails
            return this.failed();
        }
    }
    // WebUSB has no timeout: what comes after it is the next read's. {outcome, bytes}
    async read(size, timeout_s) {
        if (this.rest.length) return {outcome: kUsbOutcome.ok, bytes: this.take(size)};
        if (!this.claimed) return {outcome: this.failed(), bytes: this.rest};
        const coming = this.coming ??= this.device.transferIn(this.from, size);
        try {
            const done = await this.ended_in(coming, timeout_s);
            if (!done) return {outcome: kUsbOutcome.timeout, bytes: this.rest};
            if (this.coming === coming) this.coming = null;
            const {status, data} = done;
            if (data) this.rest = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
            return {outcome: status === 'ok' ? kUsbOutcome.ok : status === 'stall' ? kUsbOutcome.stalled : kUsbOutcome.failed, bytes: this.take(size)};
        } catch {
            if (this.coming === coming) this.coming = null;
            await pause(0);
            return {outcome: this.failed(), bytes: this.rest};
        }
    }
    take(size) {
        const bytes = this.rest.subarray(0, size);
        this.rest = this.rest.subarray(size);
        return bytes;
    }
    async clear_halt() {
        try {
            await this.device.clearHalt('in', this.from);
            return kUsbOutcome.ok;
        } catch {
            return this.failed();
        }
    }
}

// The program with its calls of module "usb". link: a UsbLink, set before run().
class UsbProgram {
    // program: a WebAssembly.Module
    static async create(program) {
        const made = new UsbProgram(), unused = () => 0, waits = (call) => new WebAssembly.Suspending(call);
        const bytes_at = (at, size) => new Uint8Array(made.memory.buffer, at, size);
        const given = {
            open: waits((endpoint_in, endpoint_out) => made.link.open(endpoint_in, endpoint_out)),
            close: () => made.link.forget(),
            is_there: () => (made.link.is_there() ? 1 : 0),
            write: waits((from, size, timeout_s) => made.link.write(bytes_at(from, size).slice(), timeout_s)),
            read: waits(async (to, size, timeout_s) => {
                const {outcome, bytes} = await made.link.read(size, timeout_s);
                bytes_at(to, bytes.length).set(bytes);
                return outcome + 16 * bytes.length;
            }),
            clear_halt: waits(() => made.link.clear_halt()),
            wait: waits((seconds) => pause(1000 * seconds)),
            now: () => performance.now() / 1000,
            proc_exit: () => { throw new Error('the program of the tracker stopped'); },
            clock_time_get: (clock, precision, at) => {
                new DataView(made.memory.buffer).setBigUint64(at, BigInt(Math.round(1e6 * performance.now())), true);
                return 0;
            },
        };
        const imports = {};
        // What is not given is only called where the program has something to print.
        for (const {module, name} of WebAssembly.Module.imports(program)) (imports[module] ??= {})[name] = given[name] ?? unused;
        const instance = await WebAssembly.instantiate(program, imports);
        made.calls = instance.exports;
        made.memory = instance.exports.memory;
        instance.exports._initialize();
        if (made.calls.value_count() !== 2 * kUsbToolValues) throw new Error('page and program are of different versions');
        return made;
    }
    text() { return new TextDecoder().decode(new Uint8Array(this.memory.buffer, this.calls.text(), this.calls.text_bytes())); }
    set_text(words) {
        const bytes = new TextEncoder().encode(words);
        new Uint8Array(this.memory.buffer, this.calls.reserve_text(bytes.length), bytes.length).set(bytes);
    }
    json() { return JSON.parse(this.text()); }
    run() { return WebAssembly.promising(this.calls.run)(); }
    tools() {
        const from = new Float64Array(this.memory.buffer, this.calls.values(), 2 * kUsbToolValues);
        return [0, kUsbToolValues].map((at) => ({status: kState[from[at]], rows: Array.from(from.subarray(at + 1, at + kUsbToolValues))}));
    }
}

export class UsbTracker extends PlacedTracker {
    constructor(scan, room, ended) {
        super(scan, room, ended, 'usb');
        this.room.replaceChildren(...this.common_parts(t('Readings'), t('Calibration file'), t('What sonocase calibrate has measured of probe, needle or mannequin')));
    }
    // Asks the user. Throws a PlainError.
    async start() {
        const {usb} = navigator;
        if (!usb) throw new PlainError(globalThis.isSecureContext ? t('This browser has no USB: use Chrome, Edge or Chromium on a computer.')
            : t('A tracker on USB needs a page from https, or from this device itself.'));
        if (!WebAssembly.Suspending) throw new PlainError(t('This browser is too old for a tracker on USB. Use a current browser.'));
        this.say(t('The browser asks for the tracker.'));
        try {
            const response = await fetch('usb.wasm');
            if (!response.ok) throw new Error(`${response.status}`);
            this.program = await UsbProgram.create(await WebAssembly.compile(await response.arrayBuffer()));
        } catch {
            throw new PlainError(t('The program of the tracker did not load. Check the network, then press USB tracker again.'));
        }
        if (this.stopped) return;
        const {program} = this;
        program.calls.devices();
        const known = program.json();
        let device;
        try {
            device = await usb.requestDevice({filters: known.map(([vendorId, productId]) => ({vendorId, productId}))});
        } catch (error) {
            throw new PlainError(error.name === 'NotFoundError' ? t('No tracker was chosen: plug it in, switch it on, then press USB tracker again.')
                : error.name === 'SecurityError' && self === top ? t('The browser wants to be asked at once: press USB tracker again.')
                : error.name === 'SecurityError' ? t('The frame that holds this page does not let it use USB: open the page in a window of its own.')
                : t('The tracker cannot be used: {}', error.message));
        }
        if (this.stopped) return;
        if (!program.calls.choose(device.vendorId, device.productId)) throw new PlainError(t('This device is not a tracker that is known here.'));
        await before;
        if (this.stopped) return;
        this.link = program.link = new UsbLink(device);
        this.on_usb = ({type, device: which}) => (type === 'connect' ? this.link.came(which) : this.link.went(which));
        for (const type of ['connect', 'disconnect']) usb.addEventListener(type, this.on_usb);
        this.room.scrollIntoView({block: 'nearest'});
        this.running = before = program.run().catch((error) => {
            if (this.stopped) return;
            this.stop();
            this.ended(t('The program of the tracker failed: {}', error.message));
        });
        this.look();
    }
    stop() {
        if (this.stopped) return;
        this.stopped = true;
        clearTimeout(this.next_look);
        if (this.running) this.program.calls.stop();  // it sends the device to rest, then lets go of it
        for (const type of ['connect', 'disconnect']) if (this.on_usb) navigator.usb.removeEventListener(type, this.on_usb);
        this.say_above('');
        this.room.replaceChildren();
    }
    // What it says of itself, twice a second.
    look() {
        this.program.calls.health();
        const {phase, device, message, rate_hz, in_mannequin} = this.program.json();
        this.in_mannequin = in_mannequin;
        const streams = phase === 'streaming';
        const said = this.said_by_program(message[0] ? message : null);
        if (!streams || this.newest?.at_ms < performance.now() - kSilentMs) for (const state of this.states) state.textContent = '–';
        else if (this.newest) this.show_states();
        this.delay.textContent = streams && rate_hz > 0 ? `${rate_hz.toFixed(0)} Hz` : '–';
        const again = this.link.is_there() ? '' : t('If it is not found then, press USB tracker twice.');
        this.say([device, this.setup_words, streams ? this.place_words() : '', said, again].filter((words) => words).join(' · '));
        this.say_above(said && (!streams || this.is_placed()) ? said : '');
        this.next_look = setTimeout(() => this.look(), kHealthMs);
    }
    async use_file(file) {
        if (!file) return;
        this.program.set_text(`${await file.text()}\n${file.name}`);
        this.setup_words = this.program.calls.use_calibration() ? '' : this.said_by_program(this.program.json());
        if (!this.setup_words) this.placed = null;  // lengths change
    }
    not_good_words() { return t('The pose of the probe is not good: bring it closer to the transmitter, away from metal.'); }
    is_placed() { return this.in_mannequin || super.is_placed(); }
    take() {
        if (this.link && this.program.calls.poll()) this.newest = {tools: this.program.tools(), fresh: true, at_ms: performance.now()};
        return super.take();
    }
}
