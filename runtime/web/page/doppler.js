// SPDX-License-Identifier: Apache-2.0

// The Doppler modes on the scanning page: switch, console, box and gate, strip, sound. What they show is the program's,
// as the desktop has it.
import {kDopplerModes} from './core.js';
import {t} from './words.js';

const kStripPart = 0.34, kStripSide = 8, kStripRoom = 60;  // part of the picture's height; px beside the strip
const kStripWide = 768, kStripHigh = 192;
const kSpectrumSeconds = 4, kMColumns = 5.12;
const kReachPx = 14, kFingerReachPx = 22;
const $ = (id) => document.getElementById(id);

// Each setting of the console, and where its value is shown.
const kFields = {
    'd-scale': ['scale', 1], 'd-gain': ['gain_db', 1], 'd-filter': ['wall_filter', 0.01], 'd-zero': ['baseline', 1],
    'd-steer': ['steer_deg', 1], 'd-angle': ['angle_deg', 1], 'd-gate': ['gate_mm', 1], 'd-line': ['gate_line', 0.01],
    'd-depth': ['gate_depth_mm', 10], 'd-left': ['box_left', 0.01], 'd-right': ['box_right', 0.01],
    'd-top': ['box_top_mm', 10], 'd-bottom': ['box_bottom_mm', 10]};

export class Doppler {
    constructor(scan) {
        this.scan = scan;
        this.mode = 'off';
        const click = (id, what) => $(id).addEventListener('click', what);
        for (const button of document.querySelectorAll('#modes button')) button.addEventListener('click', () => this.choose(button.dataset.mode));
        click('d-aim', () => this.aim());
        click('d-invert', () => this.change({invert: this.settings().invert ? 0 : 1}));
        click('d-power', () => this.choose(this.mode === 'power' ? 'colour' : 'power'));
        click('d-sound', () => this.sounds(!this.audio));
        for (const [id, [name, part]] of Object.entries(kFields)) scan.number(id, (shown) => this.change({[this.setting(name)]: shown * part}));
    }
    get core() { return this.scan.core; }
    settings() { return this.core.doppler(); }
    setting(name) { return name !== 'scale' ? name : this.mode === 'spectral' ? 'spectral_scale_cm_s' : 'scale_cm_s'; }
    has_strip() { return this.mode === 'spectral' || this.mode === 'm_mode'; }
    strip_part() { return this.has_strip() ? kStripPart : 0; }

    // A case and an exercise have been opened: everything as it was made.
    show() {
        this.normal ??= this.settings();
        this.core.set_doppler(this.normal);
        this.mode = 'off';
        this.aimed = false;
        this.say_console();
    }
    choose(mode) {
        if (mode === this.mode) return;
        const {scan} = this;
        try {
            this.core.set_doppler({...this.settings(), mode: kDopplerModes.indexOf(mode)});
        } catch (error) {
            scan.notice(error.message);
            if (scan.values.segments_left) this.choose_later(mode);
            return;
        }
        this.mode = mode;
        scan.notice('');
        if (mode !== 'off' && !this.aimed) {
            this.core.calls.aim_doppler();
            this.aimed = true;
        }
        if (mode !== 'off' && mode !== 'm_mode' && !this.core.values().has_flow)
            scan.notice(t('This case says nothing about the flow of blood, so that Doppler modes show none.'));
        this.say_console();
        scan.fit_later();
        scan.touched();
    }
    // Blood flow comes late.
    choose_later(mode) {
        const {scan, core} = this, {description} = scan;
        scan.notice(t('Doppler modes are shown as soon as the case has loaded.'));
        scan.page.arriving_case.whole.then(() => {
            if (scan.core === core && scan.description === description) this.choose(mode);
        }, () => {});
    }
    change(some) {
        const wanted = {...this.settings(), ...some};
        // A box keeps its size rather than turn inside out.
        wanted.box_right = Math.max(wanted.box_right, Math.min(wanted.box_left + 0.08, 1));
        wanted.box_bottom_mm = Math.max(wanted.box_bottom_mm, wanted.box_top_mm + 5);
        this.core.set_doppler(wanted);
        this.say_console();
        this.scan.touched();
    }
    aim() {
        if (!this.core.calls.aim_doppler()) this.scan.notice(t('The picture\'s plane cuts no open vessel here: slide or tilt the probe.'));
        this.say_console();
        this.scan.touched();
    }
    say_console() {
        const settings = this.settings(), linear = this.core.calls.steers();
        for (const button of document.querySelectorAll('#modes button'))
            button.setAttribute('aria-pressed', String(button.dataset.mode === (this.mode === 'power' ? 'colour' : this.mode)));
        $('doppler').hidden = this.mode === 'off';
        for (const row of document.querySelectorAll('#doppler [data-modes]'))
            row.hidden = !row.dataset.modes.split(' ').includes(this.mode) || (row.dataset.linear !== undefined && !linear);
        for (const [id, [name, part]] of Object.entries(kFields)) {
            const field = $(id), step = Number(field.step);
            field.value = Number((step * Math.round(settings[this.setting(name)] / part / step)).toFixed(2));
            field.setAttribute('aria-invalid', 'false');
        }
        $('d-scale').max = this.mode === 'spectral' ? 300 : 150;
        $('d-invert').setAttribute('aria-pressed', String(settings.invert === 1));
        $('d-power').setAttribute('aria-pressed', String(this.mode === 'power'));
        $('d-sound').setAttribute('aria-pressed', String(Boolean(this.audio)));
    }

    // What a pointer drags in the picture; false: nothing of Doppler.
    take(e) {
        this.held = 0;
        if (this.mode === 'off') return false;
        const at = this.place(e.clientX, e.clientY), reach = e.pointerType === 'mouse' ? kReachPx : kFingerReachPx;
        this.held = this.core.calls.hold_doppler(at.x, at.z, reach * this.scan.mm_per_css_px());
        return this.held !== 0;
    }
    drag(before, e) {
        const from = this.place(before.x, before.y), to = this.place(e.clientX, e.clientY);
        this.core.calls.drag_doppler(this.held, from.x, from.z, to.x, to.z);
        this.say_console();
        this.scan.touched();
    }
    let_go() { this.held = 0; }
    place(client_x, client_y) {
        const {picture, values} = this.scan, at = picture.mm_at(client_x, client_y, values);
        return {x: this.scan.flip_sign() * at.x, z: at.z};
    }

    // Colours of the overlay as words of the picture.
    colours() {
        const of = this.mode === 'power' ? 'power' : 'colour';
        this.palettes ??= {};
        this.palettes[of] ??= (() => {
            const rgb = this.core.palette(of === 'power');
            return new Uint32Array(256).map((unused, n) => 0xff000000 | rgb[3 * n + 2] << 16 | rgb[3 * n + 1] << 8 | rgb[3 * n]);
        })();
        return this.palettes[of];
    }
    // After a picture: its strip, its words, its sound.
    picture_drawn() {
        const canvas = $('strip'), grey = this.core.strip(kStripWide, kStripHigh);
        canvas.hidden = !grey;
        if (grey) {
            const context = canvas.getContext('2d', {alpha: false});
            const image = context.createImageData(kStripWide, kStripHigh), words = new Uint32Array(image.data.buffer);
            for (let n = 0; n < words.length; ++n) words[n] = this.scan.picture.grey[grey[n]];
            context.putImageData(image, 0, 0);
        }
        if (this.mode !== 'off' && this.scan.frames % 10 === 0) $('doppler-words').textContent = this.words();
        this.play();
    }
    words() {
        const v = this.scan.values;
        if (this.mode === 'm_mode') return t('Depth over time; a tick per second');
        if (!v.has_flow) return t('No flow in this case');
        if (this.mode !== 'spectral') return t('%.0f pictures per second', v.machine_hz);
        if (!v.beats) return t('PSV, EDV and RI after one beat');
        return t('PSV %.1f  EDV %.1f cm/s  RI %.2f  flow %.0f ml/min', v.psv, v.edv, v.resistive_index, v.flow);
    }

    // Box or gate, and the axes of strip and colours. on: of picture.js
    draw_over(on) {
        if (this.mode === 'off') return;
        const points = this.core.doppler_marks().map(({x, z}) => [on.x_of(on.flip * x), on.y_of(z)]);
        if (this.has_strip()) {
            this.draw_gate(on, points);
            this.draw_axes(on);
        } else {
            points.forEach((point, n) => on.line(...point, ...points[(n + 1) % points.length]));
            this.draw_colours(on);
        }
    }
    draw_gate(on, [face, end, upper, lower, middle]) {
        on.to.setLineDash([3, 6]);
        on.line(...face, ...end);
        on.to.setLineDash([]);
        if (this.mode !== 'spectral') return;
        const length = Math.max(Math.hypot(end[0] - face[0], end[1] - face[1]), 1);
        const ux = (end[0] - face[0]) / length, uy = (end[1] - face[1]) / length;
        for (const [x, y] of [upper, lower]) on.line(x + 11 * uy, y - 11 * ux, x - 11 * uy, y + 11 * ux);
        const angle = on.flip * this.settings().angle_deg * Math.PI / 180, c = Math.cos(angle), s = Math.sin(angle);
        const ax = c * ux - s * uy, ay = s * ux + c * uy;
        for (const side of [-1, 1]) on.line(middle[0] + side * 8 * ax, middle[1] + side * 8 * ay, middle[0] + side * 34 * ax, middle[1] + side * 34 * ay);
    }
    draw_colours(on) {
        const high = Math.min(110, on.height / 4), top = on.height - 16 - high, words = this.colours(), settings = this.settings();
        for (let n = 0; n < 48; ++n) {
            const index = 1 + Math.floor((47 - n) * 254 / 47), word = words[settings.invert && this.mode === 'colour' ? 256 - index : index];
            on.to.fillStyle = `rgb(${word & 255} ${word >> 8 & 255} ${word >> 16 & 255})`;
            on.to.fillRect(12, top + n * high / 48, 9, high / 48 + 0.6);
        }
        if (this.mode !== 'colour') return;
        const scale = Math.round(settings.scale_cm_s), [plus, minus] = settings.invert ? ['-', '+'] : ['+', '-'];
        on.say(`${plus}${scale} cm/s`, 26, top + 10);
        on.say(`${minus}${scale}`, 26, top + high);
    }
    draw_axes(on) {
        const strip = $('strip').getBoundingClientRect(), box = this.scan.picture.box.getBoundingClientRect(), v = this.scan.values;
        const left = strip.left - box.left, top = strip.top - box.top, right = left + strip.width, bottom = top + strip.height;
        const seconds = this.mode === 'spectral' ? kSpectrumSeconds : kMColumns;
        for (let n = 1; n < seconds; ++n) on.line(right - strip.width * n / seconds, bottom - 5, right - strip.width * n / seconds, bottom);
        on.say(this.words(), left + 4, top - 6);
        const tick = (y, text) => {
            on.line(right + 2, y, right + 6, y);
            on.say(text, right + 9, Math.min(Math.max(y + 5, top + 10), bottom));
        };
        if (this.mode === 'm_mode') {
            const step = [1, 2, 5, 10].find((cm) => strip.height * 10 * cm / v.depth_mm >= 20) ?? 10;
            for (let cm = step; 10 * cm < v.depth_mm; cm += step) tick(top + strip.height * 10 * cm / v.depth_mm, String(cm));
            return;
        }
        const {baseline, spectral_scale_cm_s: scale, invert} = this.settings(), sign = invert ? -1 : 1;
        tick(top, String(Math.round(sign * scale * (1 + baseline))));
        tick(top + strip.height * (0.5 + 0.5 * baseline), '0');
        tick(bottom, String(Math.round(-sign * scale * (1 - baseline))));
    }

    // A browser makes sound only after a press of a key or button.
    sounds(on) {
        this.audio?.close();
        this.audio = undefined;
        try {
            if (on) this.audio = Object.assign(new AudioContext(), {next_s: 0, loudest: 0, left: 0});
        } catch {
            this.scan.notice(t('This browser makes no sound.'));
        }
        this.say_console();
    }
    // Samples come at the rate of the scale; towards in the left ear, away in the right one.
    play() {
        const {audio} = this;
        if (!audio || this.scan.frozen) return;
        const pairs = this.core.sound(), count = pairs.length / 2, hz = this.scan.values.sound_hz;
        if (!count || !(hz > 0) || audio.next_s > audio.currentTime + 0.4) return;
        // Halves in two seconds where it has become quiet.
        audio.loudest *= 2 ** (-0.5 * count / hz);
        for (const value of pairs) audio.loudest = Math.max(audio.loudest, Math.abs(value));
        const gain = 0.5 / Math.max(audio.loudest, 1e-6), step = hz / audio.sampleRate;
        const length = Math.ceil((count - audio.left) / step);
        if (length < 1) return;
        const buffer = audio.createBuffer(2, length, audio.sampleRate);
        for (const ear of [0, 1]) {
            const to = buffer.getChannelData(ear);
            for (let n = 0; n < length; ++n) {
                const at = audio.left + n * step, i = Math.floor(at), next = Math.min(i + 1, count - 1);
                to[n] = gain * (pairs[2 * i + ear] + (at - i) * (pairs[2 * next + ear] - pairs[2 * i + ear]));
            }
        }
        audio.left += length * step - count;
        const source = audio.createBufferSource();
        source.buffer = buffer;
        source.connect(audio.destination);
        audio.next_s = Math.max(audio.next_s, audio.currentTime + 0.03);
        source.start(audio.next_s);
        audio.next_s += length / audio.sampleRate;
    }
}
