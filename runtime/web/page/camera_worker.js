// SPDX-License-Identifier: Apache-2.0

// Worker of the page's camera: pictures in, poses out (program/camera_exports.cpp). It asks for nothing from anywhere:
// the page hands it the compiled program and one picture after another. Runs in node as well, for tests.
//   in:   {program, setup, name}   once; setup: text of a camera's file, name: of that file
//         {picture, taken_ms}      a VideoFrame or an ImageBitmap, and when it was taken on the clock of kNow
//   out:  {failed}                 a sentence; nothing more comes
//         {refused}                a sentence: these pictures cannot be used; pictures of another size may be
//         {tools, message, taken_ms, at_ms, took_ms}   tools: [{status, sigma_mm, tags, two_poses, rows}] of probe and needle
//   Sentences are [format, ...words].
const kNow = () => performance.timeOrigin + performance.now();
const kStatus = ['lost', 'poor', 'good'];
const kToolValues = 20;  // camera_exports.cpp

export class CameraProgram {
    // program: a WebAssembly.Module
    static async create(program) {
        const camera = new CameraProgram(), unused = () => 0;
        const given = {proc_exit: () => { throw new Error('the camera program stopped'); }, emscripten_notify_memory_growth: unused};
        const imports = {};
        // What is not given is only called where the program has something to print or to read.
        for (const {module, name} of WebAssembly.Module.imports(program)) (imports[module] ??= {})[name] = given[name] ?? unused;
        const instance = await WebAssembly.instantiate(program, imports);
        camera.calls = instance.exports;
        camera.memory = instance.exports.memory;
        instance.exports._initialize();
        if (camera.calls.value_count() !== 2 * kToolValues) throw new Error('page and program are of different versions');
        return camera;
    }
    text() {
        return new TextDecoder().decode(new Uint8Array(this.memory.buffer, this.calls.text(), this.calls.text_bytes()));
    }
    sentence() { return this.text().split('\n'); }
    // Null, or why not.
    use_setup(setup, name) {
        const bytes = new TextEncoder().encode(`${setup}\n${name}`), at = this.calls.reserve_text(bytes.length);
        new Uint8Array(this.memory.buffer).set(bytes, at);
        return this.calls.use_setup() ? null : this.sentence();
    }
    begin(width, height) {
        Object.assign(this, {width, height});
        return this.calls.begin(width, height) ? null : this.sentence();
    }
    // Memory for a picture with its grey values first.
    room(bytes) { return new Uint8Array(this.memory.buffer, this.calls.grey(bytes), bytes); }
    colour_room() { return new Uint8Array(this.memory.buffer, this.calls.colours(), 4 * this.width * this.height); }
    // now(): in milliseconds, as taken_ms
    follow(taken_ms, now) {
        this.calls.follow(taken_ms / 1000, now() / 1000);
        const message = this.sentence(), at_ms = now(), from = this.calls.poses_at(at_ms / 1000);
        const values = new Float64Array(this.memory.buffer, from, 2 * kToolValues);
        const tools = [0, 1].map((tool) => {
            const [status, sigma_mm, tags, two_poses, ...rows] = values.slice(tool * kToolValues, (tool + 1) * kToolValues);
            return {status: kStatus[status], sigma_mm, tags, two_poses: two_poses !== 0, rows};
        });
        return {tools, message: message[0] ? message : null, taken_ms, at_ms};
    }
}

// Brings grey values of a VideoFrame into the program: its first plane, where it has one.
async function grey_of_video(camera, picture) {
    const format = picture.format ?? '';
    if (/^(I4(20|22|44)A?|NV12)$/.test(format)) {
        const {width, height} = camera;
        const columns = format.startsWith('I444') ? width : (width + 1) >> 1, rows = /^(I420|NV12)/.test(format) ? (height + 1) >> 1 : height;
        // Grey without gaps, then colour, then how opaque it is.
        const colour = format === 'NV12' ? [[2 * columns, rows]] : [[columns, rows], [columns, rows]];
        let bytes = 0;
        const layout = [[width, height], ...colour, ...format.endsWith('A') ? [[width, height]] : []].map(([stride, lines]) => {
            bytes += stride * lines;
            return {offset: bytes - stride * lines, stride};
        });
        await picture.copyTo(camera.room(bytes), {layout});
        if (!picture.colorSpace?.fullRange) camera.calls.widen();
    } else if (/^(RGB|BGR)[AX]$/.test(format)) {
        await picture.copyTo(camera.colour_room());
        camera.calls.take_colours(format.startsWith('B') ? 1 : 0);
    } else {
        grey_of_drawn(camera, picture);
    }
}
let canvas;
function grey_of_drawn(camera, picture) {
    if (canvas?.width !== camera.width || canvas.height !== camera.height) canvas = new OffscreenCanvas(camera.width, camera.height);
    const context = canvas.getContext('2d', {willReadFrequently: true});
    context.drawImage(picture, 0, 0);
    camera.colour_room().set(context.getImageData(0, 0, camera.width, camera.height).data);
    camera.calls.take_colours(0);
}

let camera, size = '';
async function take({picture, taken_ms}) {
    const start = performance.now();
    const width = picture.displayWidth ?? picture.width, height = picture.displayHeight ?? picture.height;
    try {
        if (`${width} ${height}` !== size) {
            const refused = camera.begin(width, height);
            if (refused) return {refused};
            size = `${width} ${height}`;
        }
        if (picture.copyTo && picture.visibleRect?.width === width && picture.visibleRect.height === height) await grey_of_video(camera, picture);
        else grey_of_drawn(camera, picture);
    } finally {
        picture.close();
    }
    return {...camera.follow(taken_ms, kNow), took_ms: performance.now() - start};
}
async function answer({program, setup, name, picture, taken_ms}) {
    if (!program) return take({picture, taken_ms});
    camera = await CameraProgram.create(program);
    const failed = setup ? camera.use_setup(setup, name) : null;
    return failed ? {failed} : {ready: true};
}
if (globalThis.WorkerGlobalScope)
    onmessage = async ({data}) => {
        try {
            postMessage(await answer(data));
        } catch (error) {
            postMessage({failed: ['The camera program failed: {}', error.message]});
        }
    };
