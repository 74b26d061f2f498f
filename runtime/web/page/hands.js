// SPDX-License-Identifier: Apache-2.0

// Hands on the page: mouse, pen, fingers, keys, game controller and the device's own tilt move
// probe and needle. Factors are those of the desktop's window.

import {hold_console, press_key} from './scan_keys.js';

const kLongPressMs = 500;
const kStillPx = 8;

export class Hands {
    // scan: the page that is moved (scan.js); picture: its canvas
    constructor(scan, picture) {
        this.scan = scan;
        this.picture = picture;
        this.pointers = new Map();
        this.held = new Set();  // key codes
        this.modifiers = {shift: false, alt: false, ctrl: false};
        this.follow_tilt = false;
        this.listen();
    }

    listen() {
        const on = (type, what) => this.picture.addEventListener(type, what);
        on('pointerdown', (e) => this.down(e));
        on('pointermove', (e) => this.move(e));
        for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) on(type, (e) => this.up(e));
        on('pointerleave', () => this.hover(null));
        on('wheel', (e) => this.wheel(e));
        on('contextmenu', (e) => e.preventDefault());
        addEventListener('keydown', (e) => this.key(e, true));
        addEventListener('keyup', (e) => this.key(e, false));
        addEventListener('blur', () => this.let_go());
        addEventListener('deviceorientation', (e) => this.tilted(e));
    }
    let_go() {
        this.held.clear();
        this.pointers.clear();
        this.scan.doppler?.let_go();
        clearTimeout(this.long_press);
    }

    down(e) {
        this.picture.focus({preventScroll: true});
        this.picture.setPointerCapture(e.pointerId);
        this.pointers.set(e.pointerId, {x: e.clientX, y: e.clientY, from_x: e.clientX, from_y: e.clientY});
        clearTimeout(this.long_press);
        if (this.scan.measuring) {
            this.scan.measure_at(e.clientX, e.clientY);
            return;
        }
        this.scan.doppler.let_go();
        if (e.button === 0 && !e.shiftKey && this.pointers.size === 1 && this.scan.doppler.take(e)) return;
        if (e.pointerType !== 'mouse' && this.pointers.size === 1) {
            this.long_press = setTimeout(() => this.scan.bring_needle(e.clientX, e.clientY), kLongPressMs);
        }
    }
    up(e) {
        this.pointers.delete(e.pointerId);
        this.scan.doppler.let_go();
        clearTimeout(this.long_press);
    }
    // Where a mouse or pen points without pressing; a finger covers what it points at.
    hover(at) {
        this.pointer = at;
        this.scan.touched();
    }
    move(e) {
        this.hover(e.pointerType !== 'touch' && !this.pointers.size ? {x: e.clientX, y: e.clientY} : null);
        const before = this.pointers.get(e.pointerId);
        if (!before || this.scan.measuring) return;
        if (Math.hypot(e.clientX - before.from_x, e.clientY - before.from_y) > kStillPx) clearTimeout(this.long_press);
        const dx = e.clientX - before.x, dy = e.clientY - before.y;
        if (this.scan.doppler.held) {
            this.scan.doppler.drag(before, e);
        } else if (this.pointers.size >= 2) {
            this.two_fingers(e, before, dx, dy);
        } else {
            this.drag(e, dx, dy);
        }
        before.x = e.clientX;
        before.y = e.clientY;
    }
    drag(e, dx, dy) {
        const {scan} = this, calls = scan.core.calls, mm = scan.mm_per_css_px(), flip = scan.flip_sign();
        const aims = scan.values.has_needle && (e.buttons === 4 || (e.buttons === 1 && e.shiftKey));
        if (aims) {
            calls.aim_needle(-flip * dx * 0.003, dy * 0.003);
        } else if (e.buttons === 2) {
            calls.tilt(-flip * dx * 0.004, -dy * 0.004);
        } else if (e.buttons === 1 && !e.shiftKey) {
            // The picture follows the hand: to drag tissue right the probe slides left.
            calls.slide(-flip * dx * mm, dy * mm);
        }
        scan.touched();
    }
    // Fingers that move together tilt, fingers that go round turn.
    two_fingers(e, before, dx, dy) {
        const {scan} = this, calls = scan.core.calls;
        const other = [...this.pointers].find(([id]) => id !== e.pointerId)[1];
        const angle = (p) => Math.atan2(p.y - other.y, p.x - other.x);
        let turn = angle({x: e.clientX, y: e.clientY}) - angle(before);
        turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
        calls.turn(scan.flip_sign() * turn);
        calls.tilt(-scan.flip_sign() * dx * 0.002, -dy * 0.002);
        scan.touched();
    }
    wheel(e) {
        e.preventDefault();
        const calls = this.scan.core.calls;
        const notches = -Math.sign(e.deltaY) * Math.min(Math.abs(e.deltaY) / 100, 3);
        if (e.shiftKey) {
            calls.advance_needle(2 * (notches || -Math.sign(e.deltaX)));
        } else if (e.ctrlKey) {
            calls.press(-notches);
        } else {
            calls.turn(0.05 * notches);
        }
        this.scan.touched();
    }

    // Keys go by their position: KeyboardEvent.code.
    key(e, is_down) {
        Object.assign(this.modifiers, {shift: e.shiftKey, alt: e.altKey, ctrl: e.ctrlKey || e.metaKey});
        if (!is_down) {
            this.held.delete(e.code);
            return;
        }
        if (!this.scan.shown() || document.querySelector('dialog[open]')) return;
        const tag = e.target.tagName ?? '', typing = tag === 'INPUT' && e.target.type !== 'checkbox' || tag === 'SELECT';
        if (this.modifiers.ctrl) return;
        const is_function = /^F\d+$/.test(e.code);
        if (typing && !is_function) return;
        // A button keeps Space and Enter for itself.
        if ((tag === 'BUTTON' || tag === 'SUMMARY' || e.target.type === 'checkbox') && (e.code === 'Space' || e.code === 'Enter')) return;
        if (e.code === 'Tab' || e.code === 'Escape') return;
        if (!e.repeat) this.held.add(e.code);
        if (press_key(this.scan, e.code, this.modifiers, e.repeat) || this.is_movement(e.code)) e.preventDefault();
    }
    is_movement(code) { return /^(Arrow|Page|Home$)/.test(code); }

    // Once per picture: what held keys and controllers move in `seconds`.
    step(seconds) {
        this.keys(seconds);
        this.controller(seconds);
    }
    axis(negative, positive) { return (this.held.has(positive) ? 1 : 0) - (this.held.has(negative) ? 1 : 0); }
    keys(seconds) {
        if (this.held.size === 0) return;
        const calls = this.scan.core.calls, {shift, alt} = this.modifiers, by = (alt ? 0.25 : 1) * seconds;
        const x = this.axis('ArrowLeft', 'ArrowRight'), y = this.axis('ArrowDown', 'ArrowUp');
        if ((x || y) && this.scan.measuring) {
            this.scan.move_cross(30 * by * x, -30 * by * y);
        } else if (x || y) {
            if (shift) calls.tilt(0.5 * by * x, 0.5 * by * y);
            else calls.slide(50 * by * x, 50 * by * y);
        }
        const turn = this.axis('KeyQ', 'KeyE'), press = this.axis('PageUp', 'PageDown');
        if (turn) calls.turn(0.8 * by * turn);
        if (press) calls.press(12 * by * press);
        const push = this.axis('KeyS', 'KeyW'), aim = this.axis('KeyA', 'KeyD'), out = this.axis('KeyZ', 'KeyX');
        if (push) calls.advance_needle(25 * by * push);
        if (aim || out) calls.aim_needle(-0.35 * by * aim, 0.35 * by * out);
        if (shift) {
            const side = this.axis('KeyJ', 'KeyL'), up = this.axis('KeyK', 'KeyI');
            if (side || up) calls.slide_needle(30 * seconds * side, 30 * seconds * up);
        }
        hold_console(this.scan, seconds, (a, b) => this.axis(a, b), this.held);
    }
    controller(seconds) {
        const pad = navigator.getGamepads?.().find((one) => one);
        if (!pad) return;
        const calls = this.scan.core.calls;
        const stick = (n) => Math.abs(pad.axes[n] ?? 0) > 0.12 ? pad.axes[n] : 0;
        const button = (n) => pad.buttons[n]?.value ?? 0;
        if (stick(0) || stick(1)) calls.slide(50 * seconds * stick(0), -50 * seconds * stick(1));
        if (stick(2) || stick(3)) calls.tilt(0.5 * seconds * stick(2), -0.5 * seconds * stick(3));
        const turn = button(5) - button(4), push = button(7) - button(6);
        if (turn) calls.turn(0.8 * seconds * turn);
        if (push) calls.advance_needle(25 * seconds * push);
        const takes = button(0) > 0.5;
        if (takes && !this.took) this.scan.toggle_needle(true);
        this.took = takes;
    }

    // Asked for with a click, because phones allow the question only then. False: not allowed.
    async use_tilt(on) {
        this.follow_tilt = false;
        this.tilt_before = null;
        if (!on) return true;
        const ask = globalThis.DeviceOrientationEvent?.requestPermission;
        if (ask && await ask.call(DeviceOrientationEvent).catch(() => 'denied') !== 'granted') return false;
        this.follow_tilt = 'DeviceOrientationEvent' in globalThis;
        return this.follow_tilt;
    }
    tilted(e) {
        if (!this.follow_tilt || e.beta === null || !this.scan.shown()) return;
        const now = {beta: e.beta, gamma: e.gamma}, before = this.tilt_before ?? now;
        const radians = (degrees) => degrees * Math.PI / 180;
        // A jump is the device's change of its own branch of angles, not a hand.
        if (Math.abs(now.beta - before.beta) < 20 && Math.abs(now.gamma - before.gamma) < 20)
            this.scan.core.calls.tilt(radians(now.gamma - before.gamma), radians(before.beta - now.beta));
        this.tilt_before = now;
        this.scan.touched();
    }
}
