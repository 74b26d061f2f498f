// SPDX-License-Identifier: Apache-2.0

// pixels_test.mjs PROGRAM_FOLDER BIN_FOLDER [CASE SESSION]: both programs of the page, in node: 60 pictures per model
// with a needle equal the desktop's byte for byte, and an attempt has the scores of the desktop's replay.
import {readFileSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin, given_case, given_session] = process.argv.slice(2);
const {Core} = await import(pathToFileURL(join(import.meta.dirname ?? new URL('.', import.meta.url).pathname, '../../../runtime/web/page/core.js')));
const oracle = join(bin, 'web_oracle');
const work = folder();
const case_file = given_case ?? join(work, 'small.sonocase'), session_file = given_session ?? join(work, 'small.igs.mha');
if (!given_case) run(join(bin, 'core_write_case'), case_file, session_file);
const case_bytes = readFileSync(case_file);

async function open(name) {
    const core = await Core.create(await WebAssembly.compile(readFileSync(join(program, name))));
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
    const wanted = JSON.parse(run(oracle, 'frames', case_file, session_file, model, String(side)));
    const core = await open(name);
    core.choose_exercise(0, side);
    core.set_image({model_paper: model === 'paper', side, depth_mm: 0, focus_mm: 0});
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

await run_tests({
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
