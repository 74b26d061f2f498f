// SPDX-License-Identifier: Apache-2.0

// The program (program/exports.cpp) as an object: memory, texts and calls. Runs in pages and in
// node alike.

import {t} from './words.js';

// The values that the program returns, in the order of exports.cpp.
export const kValues = [
    'width', 'height', 'mm_per_px', 'origin_x', 'origin_y', 'depth_mm', 'focus_mm', 'model_paper', 'has_needle',
    'needle_depth_mm', 'in_contact', 'press_mm', 'kept', 'attempt', 'seconds', 'insertions',
    'targets_hit', 'tip_to_target_mm', 'tip_in_view', 'in_no_go', 'damaged', 'frame_number',
    'missing', 'segments_left', 'has_flow', 'machine_hz', 'sound_hz', 'beats', 'psv', 'edv', 'resistive_index', 'flow'];

// The settings of the Doppler modes, in the order of exports.cpp; mode as in kDopplerModes.
export const kDoppler = [
    'mode', 'box_left', 'box_right', 'box_top_mm', 'box_bottom_mm', 'steer_deg', 'scale_cm_s',
    'spectral_scale_cm_s', 'baseline', 'invert', 'wall_filter', 'gain_db', 'gate_line',
    'gate_depth_mm', 'gate_mm', 'angle_deg'];
export const kDopplerModes = ['off', 'colour', 'power', 'spectral', 'm_mode'];

// What put_tools() is told, in the order of exports.cpp.
const kToolStates = ['absent', 'good', 'poor', 'lost'], kTrackers = ['', 'poses', 'camera', 'usb'];

export const kFrameStatus = ['rendered', 'held_bad_pose', 'no_contact'];

// The smallest module that uses a 128-bit instruction: (func (result v128) i32.const 0 i8x16.splat ...).
const kSimdModule = new Uint8Array([
    0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15,
    253, 98, 11]);
export const has_simd = () => WebAssembly.validate(kSimdModule);

// A failure in words for the person at the page.
export class PlainError extends Error {}

export class Core {
    // program: a WebAssembly.Module
    static async create(program) {
        const core = new Core();
        const unused = () => 0;
        const imports = {
            env: {emscripten_notify_memory_growth: unused},
            wasi_snapshot_preview1: {
                proc_exit: () => { throw new PlainError(t('The program stopped. Load the page again.')); },
                fd_write: (fd, parts, count, written) => core.write(parts, count, written),
                fd_close: unused, fd_seek: unused, fd_read: unused,
                environ_sizes_get: (count, bytes) => {
                    new DataView(core.memory.buffer).setUint32(count, 0, true);
                    new DataView(core.memory.buffer).setUint32(bytes, 0, true);
                    return 0;
                },
                environ_get: unused,
                clock_time_get: unused,
            },
        };
        for (const {module, name} of WebAssembly.Module.imports(program)) {
            if (!imports[module] || !imports[module][name])
                throw new PlainError(t('The program asks for {}, which this page lacks.', `${module}.${name}`));
        }
        const instance = await WebAssembly.instantiate(program, imports);
        core.calls = instance.exports;
        core.memory = instance.exports.memory;
        instance.exports._initialize?.();
        core.away_s = 0;
        if (core.calls.value_count() !== kValues.length)
            throw new PlainError(t('Page and program are of different versions. Load the page again.'));
        return core;
    }

    write(parts, count, written) {  // what the standard library says before it aborts
        const view = new DataView(this.memory.buffer);
        let bytes = 0, text = '';
        for (let n = 0; n < count; ++n) {
            const from = view.getUint32(parts + 8 * n, true), size = view.getUint32(parts + 8 * n + 4, true);
            text += this.words(from, size);
            bytes += size;
        }
        view.setUint32(written, bytes, true);
        console.error(text);
        return 0;
    }

    words(from, size) {
        return new TextDecoder().decode(new Uint8Array(this.memory.buffer, from, size).slice());
    }
    text() { return this.words(this.calls.text(), this.calls.text_bytes()); }
    set_text(text) {
        const bytes = new TextEncoder().encode(text), at = this.calls.reserve_text(bytes.length);
        new Uint8Array(this.memory.buffer).set(bytes, at);  // after the call: memory may have grown
    }
    // Throws the program's own sentence where a call failed.
    check(done) {
        if (!done) throw new PlainError(this.text());
    }

    // Where a case of `bytes` bytes goes; fill it with put() and then open().
    reserve(bytes) {
        this.case_at = this.calls.reserve(bytes);
        this.case_bytes = bytes;
    }
    put(bytes, at) { new Uint8Array(this.memory.buffer).set(bytes, this.case_at + at); }
    digest_of(at, count) {
        this.calls.digest(this.case_at + at, count);
        return this.text();
    }
    // A case that arrives in segments: after reserve(). hashes: eight bytes for each.
    begin_segments(segment_bytes, hashes) {
        const at = this.calls.begin_segments(segment_bytes);
        new Uint8Array(this.memory.buffer).set(hashes, at);
    }
    look_again() { this.check(this.calls.look_again()); }
    // What to fetch next: [{first, count}] of segments.
    next_runs(max_segments) {
        const count = this.calls.next_runs(max_segments);
        const pairs = new Uint32Array(this.memory.buffer, this.calls.runs(), 2 * count).slice();
        return Array.from({length: count}, (unused, n) => ({first: pairs[2 * n], count: pairs[2 * n + 1]}));
    }
    // Returns the description of page_json.h.
    open(name) {
        this.set_text(name);
        this.check(this.calls.open_case());
        return JSON.parse(this.text());
    }
    // A little of the check of the author's signature: null until it is done.
    check_signature() { return this.calls.check_signature() ? JSON.parse(this.text()) : null; }
    choose_exercise(index, width, height = width) { this.check(this.calls.choose_exercise(index, width, height)); }
    set_image({model_paper, width, height, depth_mm, focus_mm}) {
        this.check(this.calls.set_image(model_paper ? 1 : 0, width, height, depth_mm, focus_mm));
    }
    set_console({gain_db, range_db, tgc_db, flip}) {
        this.calls.set_console(gain_db, range_db, flip ? 1 : 0);
        tgc_db.forEach((db, n) => this.calls.set_tgc(n, db));
    }
    // From the last picture: {gain_db, tgc_db}.
    adjusted_gain() {
        const [gain_db, ...tgc_db] = new Float64Array(this.memory.buffer, this.calls.adjust_gain(), 9);
        return {gain_db, tgc_db};
    }
    values() {
        const at = this.calls.values(), from = new Float64Array(this.memory.buffer, at, kValues.length);
        return Object.fromEntries(kValues.map((name, n) => [name, from[n]]));
    }
    // The program's clock stands still while nobody sees the page: what its calls take as now_s, here and below, is the
    // browser's time, s, less what passed meanwhile.
    stand_still(seconds) { this.away_s += seconds; }
    // A picture of now; unseen: behind a frozen one.
    frame(now_s) { return this.calls.frame(now_s - this.away_s); }
    frame_unseen(now_s) { this.calls.frame_unseen(now_s - this.away_s); }
    // A view of the program's memory, valid until the next call.
    pixels() {
        const {width, height} = this.values();
        return new Uint8Array(this.memory.buffer, this.calls.pixels(), width * height);
    }
    // The same as words of a screen: red, green, blue, 255.
    screen() {
        const {width, height} = this.values();
        return new Uint32Array(this.memory.buffer, this.calls.screen(), width * height);
    }
    // probe, needle: 16 numbers, rows of mannequin_from_...; needle may be null. states: of both, by kToolStates. tracker:
    // of kTrackers, as a recording names it.
    put_tools(now_s, probe, needle, states = ['good', needle ? 'good' : 'absent'], tracker = '') {
        const at = this.calls.poses(), to = new Float64Array(this.memory.buffer, at, 32);
        to.set(probe);
        if (needle) to.set(needle, 16);
        this.calls.put_tools(now_s - this.away_s, ...states.map((state) => kToolStates.indexOf(state)), kTrackers.indexOf(tracker));
    }
    // Hands the probe back to the start; rows of mannequin_from_probe there.
    probe_home() {
        this.calls.probe_home();
        return new Float64Array(this.memory.buffer, this.calls.hands_pose(), 16).slice();
    }
    // seed: that targets and start are drawn with; 0: as written.
    start_attempt(trainee, started, now_s, seed = 0) {
        this.set_text(`${trainee.replaceAll('\n', ' ')}\n${started}`);
        this.check(this.calls.start_attempt(now_s - this.away_s, seed));
    }
    // The targets of the last picture, mm in the probe's frame: y is the distance to the plane.
    targets() {
        const count = this.calls.target_count();
        const from = new Float64Array(this.memory.buffer, this.calls.numbers(), 4 * count);
        return Array.from({length: count}, (unused, n) => ({x: from[4 * n], y: from[4 * n + 1], z: from[4 * n + 2], radius: from[4 * n + 3]}));
    }
    // The console of the Doppler modes, by name.
    doppler() {
        const from = new Float64Array(this.memory.buffer, this.calls.doppler(), kDoppler.length);
        return Object.fromEntries(kDoppler.map((name, n) => [name, from[n]]));
    }
    set_doppler(settings) {
        const to = new Float64Array(this.memory.buffer, this.calls.doppler(), kDoppler.length);
        kDoppler.forEach((name, n) => { to[n] = settings[name]; });
        this.check(this.calls.set_doppler());
    }
    // Points of the scan plane, mm: the colour box's outline, or face, end, upper, lower and middle of the gate.
    doppler_marks() {
        const count = this.calls.doppler_marks();
        const from = new Float64Array(this.memory.buffer, this.calls.numbers(), 2 * count);
        return Array.from({length: count}, (unused, n) => ({x: from[2 * n], z: from[2 * n + 1]}));
    }
    // Views of the program's memory as pixels(); null where the last picture has no such part.
    overlay() {
        const at = this.calls.overlay(), {width, height} = this.values();
        return at ? new Uint8Array(this.memory.buffer, at, width * height) : null;
    }
    strip(width, height) {
        const at = this.calls.strip(width, height);
        return at ? new Uint8Array(this.memory.buffer, at, width * height) : null;
    }
    // Red, green and blue of 256 colours.
    palette(power) { return new Uint8Array(this.memory.buffer, this.calls.palette(power ? 1 : 0), 768).slice(); }
    // Pairs of samples of the last picture: flow towards the probe, flow away.
    sound() { return new Float32Array(this.memory.buffer, this.calls.sound(), 2 * this.calls.sound_count()); }
    // A part of the 3-D view: eight floats a vertex (place, normal, texture), three indices a triangle, 0xRRGGBB.
    scene_part(part) {
        const count = this.calls.scene_part(part), {buffer} = this.memory;
        return {vertices: new Float32Array(buffer, this.calls.scene_vertices(), 8 * count),
            indices: new Uint32Array(buffer, this.calls.scene_indices(), this.calls.scene_index_count()), rgb: this.calls.scene_rgb(part)};
    }
    scene_first() {
        this.calls.scene_first();
        const [yaw, pitch, distance] = new Float64Array(this.memory.buffer, this.calls.numbers(), 3);
        return {yaw, pitch, distance};
    }
    // Rows of camera_from_mannequin, mannequin_from_probe, mannequin_from_needle. from: 0 outside, 1 probe, 2 needle.
    scene_places(from, {yaw, pitch, distance}) {
        this.calls.scene_places(from, yaw, pitch, distance);
        const at = this.calls.numbers();
        return [0, 1, 2].map((n) => new Float64Array(this.memory.buffer, at + 128 * n, 16).slice());
    }
    // The name of what a pixel of the last picture shows.
    name_at(column, row) {
        this.calls.name_at(column, row);
        return this.text();
    }
    attempt_words() {
        this.calls.attempt_words();
        return JSON.parse(this.text());
    }
    // Where the procedure of the attempt stands (page_json.h); null: the exercise has none.
    procedure() {
        this.calls.procedure();
        const state = JSON.parse(this.text());
        return state.steps ? state : null;
    }
    act({kind, index, amount}) { return this.calls.act(kind, index, amount) === 1; }
    // Plays a sweep of the exercise; calls.watching() tells whether it still runs.
    watch(sweep, now_s) {
        this.set_text(sweep);
        this.check(this.calls.watch(now_s - this.away_s));
    }
    // The course of page_json.h, in a language ("en", "de").
    open_course(toml, language) {
        this.set_text(`${language}\n${toml}`);
        this.check(this.calls.open_course());
        return JSON.parse(this.text());
    }
    // How a trainee stands in that course; kept: as page_json.h has it.
    stand_in_course(kept) {
        this.set_text(JSON.stringify(kept));
        this.check(this.calls.stand_in_course());
        return JSON.parse(this.text());
    }
    // How a trainee stands with exercises, as page_json.h has it.
    stand_with(kept) {
        this.set_text(JSON.stringify(kept));
        this.check(this.calls.stand_with());
        return JSON.parse(this.text());
    }
    // {recording: bytes of an .igs.mha, score_text: JSON text, score}
    finish_attempt() {
        this.check(this.calls.finish_attempt());
        const recording = new Uint8Array(this.memory.buffer, this.calls.bytes(), this.calls.bytes_count()).slice();
        const score_text = this.text();
        return {recording, score_text, score: JSON.parse(score_text)};
    }
    metric_words() {
        this.calls.metric_words();
        return JSON.parse(this.text());
    }
    // The attempt that finished last, for the page after it (page_json.h).
    result() {
        this.calls.result();
        return JSON.parse(this.text());
    }
    // Where the guided start stands (page_json.h), once per picture; null: it does not run.
    guide(frozen) { return this.calls.guide(frozen ? 1 : 0) ? JSON.parse(this.text()) : null; }
}
