// SPDX-License-Identifier: Apache-2.0

// Probe and needle of printed markers before this device's camera (docs/cardboard.md). Fetched when the camera is chosen;
// pictures go to a worker of this page and nowhere else.
import {PlainError, has_simd} from './core.js';
import {PlacedTracker} from './placed_tracker.js';
import {element} from './scan.js';
import {t} from './words.js';

const kCameraSize = {width: {ideal: 1280}, height: {ideal: 720}, frameRate: {ideal: 30}};
const kMissed = 5;  // pictures, of a probe that is said to be lost
const kLongestAgeMs = 500;  // of a picture, by the camera's own clock; more is another clock

// Why there is no picture, in words. error: of getUserMedia.
export function words_of_camera(error) {
    switch (error.name) {
        case 'NotAllowedError': case 'SecurityError':
            return self !== top ? t('The frame that holds this page does not let it use the camera: open the page in a window of its own.')
                : t('This browser does not let the page use the camera: allow it beside the address, then press Camera again.');
        case 'NotFoundError': case 'OverconstrainedError': return t('No camera is connected: connect one, then press Camera again.');
        case 'NotReadableError': case 'AbortError': return t('Another program uses the camera: close it there, then press Camera again.');
        default: return t('The camera cannot be used: {}', error.message);
    }
}

export class CameraTracker extends PlacedTracker {
    // room: the element to fill. ended(): it stops by itself, after words.
    constructor(scan, room, ended) {
        super(scan, room, ended, 'camera');
        Object.assign(this, {setup: null, setup_words: '', pictures: 0});
        this.make_room();
    }

    make_room() {
        this.video = element('video', '', {muted: true, playsInline: true, autoplay: true});
        this.video.setAttribute('aria-label', t('What the camera sees'));
        this.choice = element('select', '', {hidden: true});
        this.choice.setAttribute('aria-label', t('Camera in use'));
        this.choice.addEventListener('change', () => this.use_again(this.choice.value));
        this.room.replaceChildren(this.video, ...this.common_parts(t('Prediction'), t('Camera file'), t('Lens and markers as sonocase calibrate has measured them')), this.choice);
    }
    // Asks the user. Throws a PlainError.
    async start() {
        if (!navigator.mediaDevices?.getUserMedia)
            throw new PlainError(t('A camera needs a page from https, or from this device itself.'));
        if (!has_simd() || !globalThis.OffscreenCanvas) throw new PlainError(t('This browser is too old for the camera. Use a current browser.'));
        await this.use('');
        if (this.stopped) return;
        this.room.scrollIntoView({block: 'nearest'});
        try {
            const response = await fetch('camera.wasm');
            if (!response.ok) throw new Error(`${response.status}`);
            this.program = await WebAssembly.compile(await response.arrayBuffer());
            if (this.stopped) return;
        } catch {
            this.stop();
            throw new PlainError(t('The program of the camera did not load. Check the network, then press Camera again.'));
        }
        this.begin_worker();
        this.changed = () => { if (!this.stream) this.use_again(this.device); };
        navigator.mediaDevices.addEventListener('devicechange', this.changed);
    }
    use_again(device) { return this.use(device).catch((error) => this.say(error.message)); }
    // device: its id; empty: the browser's choice, rather one that looks away from the user.
    async use(device) {
        this.close_stream();
        this.device = device;
        this.say(t('The browser is asked for the camera.'));
        let stream;
        try {
            stream = await navigator.mediaDevices.getUserMedia({audio: false, video: {...kCameraSize, resizeMode: 'none',
                ...device ? {deviceId: {exact: device}} : {facingMode: {ideal: 'environment'}}}});
        } catch (error) {
            throw new PlainError(words_of_camera(error));
        }
        if (this.stopped) {
            for (const track of stream.getTracks()) track.stop();
            return;
        }
        this.stream = stream;
        this.say('');
        const [track] = stream.getVideoTracks();
        track.addEventListener('ended', () => {
            if (this.stream !== stream) return;
            this.close_stream();
            this.newest = null;
            const words = t('The camera was unplugged, or is no longer allowed: plug it in again, or press Camera twice.');
            this.say(words);
            this.say_above(words);
        });
        this.video.srcObject = stream;
        this.video.play().catch(() => {});  // begins with the first picture
        this.wait_for_picture();
        await this.list_cameras(track);
    }
    // Names of cameras are told once one is allowed.
    async list_cameras(track) {
        const found = (await navigator.mediaDevices.enumerateDevices()).filter(({kind}) => kind === 'videoinput');
        this.choice.replaceChildren(...found.map(({label, deviceId}, n) => new Option(label || t('Camera %d', n + 1), deviceId)));
        this.choice.value = track.getSettings().deviceId;
        this.choice.hidden = found.length < 2;
    }
    close_stream() {
        for (const track of this.stream?.getTracks() ?? []) track.stop();
        this.stream = null;
        this.waiting?.picture.close();
        this.waiting = null;
        for (const state of this.states) state.textContent = '–';
    }
    stop() {
        this.stopped = true;
        this.close_stream();
        this.worker?.terminate();
        if (this.changed) navigator.mediaDevices.removeEventListener('devicechange', this.changed);
        this.say_above('');
        this.room.replaceChildren();
    }

    begin_worker() {
        this.worker?.terminate();
        this.waiting?.picture.close();
        this.waiting = null;
        this.busy = true;  // until it is ready
        this.worker = new Worker('camera_worker.js', {type: 'module'});
        this.worker.onmessage = ({data}) => this.answered(data);
        this.worker.onerror = () => this.fail(t('The program of the camera did not load. Check the network, then press Camera again.'));
        this.worker.postMessage({program: this.program, setup: this.setup?.text, name: this.setup?.name});
    }
    fail(words) {
        this.stop();
        this.ended(words);
    }
    async use_file(file) {
        if (!file) return;
        this.setup = {text: await file.text(), name: file.name};
        this.setup_words = '';
        this.placed = null;  // lengths change
        this.begin_worker();
    }

    // One picture after another; the newest waits while the worker is busy, older ones are dropped.
    wait_for_picture() {
        const {video, stream} = this;
        if (video.requestVideoFrameCallback) {
            video.requestVideoFrameCallback((now, {captureTime}) => this.take_picture(stream, Math.abs(now - captureTime) < kLongestAgeMs ? Math.min(captureTime, now) : now));
            return;
        }
        const look = (now) => {
            if (this.stream !== stream) return;
            if (video.currentTime === this.shown) requestAnimationFrame(look);
            else this.take_picture(stream, now);
            this.shown = video.currentTime;
        };
        requestAnimationFrame(look);
    }
    async take_picture(stream, taken) {
        if (this.stream !== stream) return;
        this.wait_for_picture();
        const taken_ms = performance.timeOrigin + taken;
        if (!this.worker || !this.scan.shown() || taken_ms <= this.taken_ms) return;  // a camera's own times may fall
        this.taken_ms = taken_ms;
        let picture;
        try {
            picture = globalThis.VideoFrame ? new VideoFrame(this.video, {timestamp: Math.round(1000 * taken)}) : await createImageBitmap(this.video);
        } catch {
            return;  // no picture yet
        }
        this.waiting?.picture.close();
        this.waiting = {picture, taken_ms};
        this.hand_over();
    }
    hand_over() {
        if (this.busy || !this.waiting) return;
        this.busy = true;
        this.worker.postMessage(this.waiting, [this.waiting.picture]);
        this.waiting = null;
    }
    answered({failed, refused, tools, message, taken_ms, at_ms, took_ms}) {
        this.busy = false;
        if (failed && this.setup) {  // the file's fault
            this.setup = null;
            this.setup_words = this.said_by_program(failed);
            this.begin_worker();
            return;
        }
        if (failed) {
            this.fail(this.said_by_program(failed));
            return;
        }
        this.hand_over();
        if (!this.stream) return;  // of a camera that has gone meanwhile
        if (refused) this.say(this.said_by_program(refused));
        if (!tools) return;
        ++this.pictures;
        this.late_ms = 0.9 * (this.late_ms ?? at_ms - taken_ms) + 0.1 * (at_ms - taken_ms);
        this.took_ms = 0.9 * (this.took_ms ?? took_ms) + 0.1 * took_ms;
        this.newest = {tools, fresh: true};
        this.scan.touched();
        this.show_states();
        this.missed = tools[0].status === 'lost' ? this.missed + 1 : 0;
        this.say_above(this.is_placed() && this.missed >= kMissed ? t('The camera does not see the probe.') : '');
        if (this.pictures % 15 === 1) this.delay.textContent = `${this.late_ms.toFixed(0)} ms`;
        this.say([this.setup_words, this.place_words(),
            this.said_by_program(message)].filter((words) => words).join(' '));
    }
    not_good_words() { return t('The pose of the probe is not good: hold it still, with the board in view.'); }
}
