// SPDX-License-Identifier: Apache-2.0

// pixels_test.mjs PROGRAM_FOLDER BIN_FOLDER [CASE SESSION]: both programs of the page, in node: 60 pictures per model
// with a needle equal the desktop's byte for byte, and an attempt has the scores of the desktop's replay.
import {readFileSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin, given_case, given_session] = process.argv.slice(2);
const {Core, kDopplerModes} = await import(pathToFileURL(join(import.meta.dirname ?? new URL('.', import.meta.url).pathname, '../../../runtime/web/page/core.js')));
const oracle = join(bin, 'web_oracle');
const work = folder();
const case_file = given_case ?? join(work, 'small.sonocase'), session_file = given_session ?? join(work, 'small.igs.mha');
if (!given_case) run(join(bin, 'core_write_case'), case_file, session_file, 'flow');
const case_bytes = readFileSync(case_file);

// Once for all tests: each program is compiled, and the desktop draws, for several of them.
const once = (make, made = new Map()) => (...key) => {
    if (!made.has(key.join())) made.set(key.join(), make(...key));
    return made.get(key.join());
};
const compiled = once((name) => WebAssembly.compile(readFileSync(join(program, name))));
const drawn = once((what, mode, side) => JSON.parse(run(oracle, what, case_file, session_file, mode, String(side))));

async function open(name) {
    const core = await Core.create(await compiled(name));
    core.reserve(case_bytes.length);
    core.put(case_bytes, 0);
    core.open(case_file);
    return core;
}
function digest(core, pixels) {  // by the program's own XXH3, of bytes put into its memory
    core.reserve(pixels.length);
    core.put(pixels, 0);
    return core.digest_of(0, pixels.length);
}

async function same_pixels(name, model) {
    const side = 512;
    const wanted = drawn('frames', model, side);
    const core = await open(name);
    core.choose_exercise(0, side);
    core.set_image({model_paper: model === 'paper', width: side, height: side, depth_mm: 0, focus_mm: 0});
    let with_needle = 0;
    const digests = new Set(), times_ms = [];
    for (const [n, frame] of wanted.slice(0, 60).entries()) {
        core.put_tools(frame.time_s, frame.probe, frame.has_needle ? frame.needle : null);
        const start = performance.now();
        core.calls.frame(frame.time_s);
        times_ms.push(performance.now() - start);
        expect_equal(digest(core, core.pixels().slice()), frame.digest, `${name}, ${model}, frame ${n}`);
        with_needle += frame.has_needle ? 1 : 0;
        digests.add(frame.digest);
    }
    times_ms.sort((a, b) => a - b);
    console.log(`       ${name} ${model}: median ${times_ms[times_ms.length >> 1].toFixed(2)} ms, slowest ${times_ms.at(-1).toFixed(2)} ms`);
    expect_equal(wanted.length >= 60, true, '60 frames');
    expect(with_needle > 0 && digests.size > 30, 'the needle is there and the pictures differ');
}

// Colour, power, spectrum and M-mode: picture, overlay, strip and what is measured are the desktop's.
async function same_doppler(name) {
    const side = 256;
    for (const mode of ['colour', 'power', 'spectral', 'm_mode']) {
        const wanted = drawn('doppler', mode, side);
        const core = await open(name), made = new Set();
        core.choose_exercise(0, side);
        core.set_image({model_paper: false, width: side, height: side, depth_mm: 0, focus_mm: 0});
        for (const [n, frame] of wanted.slice(0, 60).entries()) {
            core.put_tools(frame.time_s, frame.probe, null);
            if (n === 0) aim_at(core, frame, mode);
            core.calls.frame(frame.time_s);
            const strip = core.strip(768, 192), overlay = core.overlay();
            const parts = {digest: core.pixels().slice(), overlay: (overlay ?? new Uint8Array(side * side)).slice(),
                strip: (strip ?? new Uint8Array(768 * 192)).slice()};
            for (const [part, bytes] of Object.entries(parts))
                expect_equal(digest(core, bytes), frame[part], `${name}, ${mode}, ${part} of frame ${n}`);
            expect_equal(core.values().psv, mode === 'spectral' ? frame.psv : 0, `${mode}, peak of frame ${n}`);
            made.add(frame.overlay + frame.strip);
        }
        expect(made.size > 10, `${mode} moves: ${made.size}`);
        if (mode === 'colour') expect(wanted.some((frame) => frame.coloured > 100), 'there is colour');
        if (mode === 'spectral') expect(wanted.at(-1).psv > 1, 'blood is fast enough to be measured');
    }
}
// Box and gate as the oracle aims them: at the pose of a picture that another engine has drawn.
function aim_at(core, frame, mode) {
    const normal = core.doppler();
    core.set_doppler({...normal, mode: kDopplerModes.indexOf(mode)});
    core.calls.frame(frame.time_s);
    core.calls.aim_doppler();
    const aimed = core.doppler();
    core.choose_exercise(0, core.values().width);
    core.set_image({model_paper: false, width: core.values().width, height: core.values().height, depth_mm: 0, focus_mm: 0});
    core.set_doppler(aimed);
    core.put_tools(frame.time_s, frame.probe, null);
}

await run_tests({
    simd_doppler: () => same_doppler('sonoplay.wasm'),
    scalar_doppler: () => same_doppler('sonoplay-scalar.wasm'),
    simd_paper: () => same_pixels('sonoplay.wasm', 'paper'),
    simd_physical: () => same_pixels('sonoplay.wasm', 'physical'),
    scalar_paper: () => same_pixels('sonoplay-scalar.wasm', 'paper'),
    scalar_physical: () => same_pixels('sonoplay-scalar.wasm', 'physical'),
    async scores_are_those_of_the_desktop() {
        const core = await open('sonoplay.wasm');
        core.choose_exercise(0, 256);
        core.start_attempt('somebody', '2026-01-31T12:00:00Z', 100);
        core.calls.needle_to(0, 35);
        for (let n = 0; n < 300; ++n) {
            core.calls.advance_needle(0.3);
            core.calls.slide(0, n % 50 < 25 ? 0.2 : -0.2);
            core.calls.frame(100 + 0.04 * n);
        }
        const finished = core.finish_attempt();
        const recording = join(work, 'attempt.igs.mha');
        writeFileSync(recording, finished.recording);
        expect_equal(finished.score_text, run(oracle, 'score', case_file, recording), 'scores');
        expect(finished.score.insertions.length >= 1, 'the needle went in');
    },
    async refuses_what_is_no_case() {
        const core = await open('sonoplay.wasm');
        const altered = case_bytes.slice();
        altered[200] ^= 1;
        for (const [bytes, words] of [[case_bytes.subarray(0, 1000), 'short'], [altered, 'damaged'], [Buffer.from('holiday'), 'few']]) {
            let said = '';
            core.reserve(bytes.length);
            core.put(bytes, 0);
            try {
                core.open('mine.sonocase');
            } catch (error) {
                said = error.message;
            }
            expect(said.startsWith('mine.sonocase'), `${words}: ${said}`);
        }
    },
});
