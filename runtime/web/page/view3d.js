// SPDX-License-Identifier: Apache-2.0

// The 3-D view beside the picture: skin, organs, probe, scan plane with the picture on it, needle, targets. Meshes and
// cameras are the program's; colours and light are those of the desktop's view. Off until it is asked for.
import {t} from './words.js';

const kTanHalf = 0.36, kNear = 10, kFar = 5000;
const kRate = 15;  // views per second at most: the picture comes first
const kParts = ['skin', 'probe', 'mark', 'plane', 'needle', 'hub', 'ball'];
const $ = (id) => document.getElementById(id);

const kVertexShader = `#version 300 es
in vec3 position; in vec3 normal; in vec2 texture_at;
uniform mat4 clip_from_view, view_from_model;
out vec3 view_normal; out vec3 view_position; out vec2 at;
void main() {
    vec4 place = view_from_model * vec4(position, 1.0);
    gl_Position = clip_from_view * place;
    view_normal = mat3(view_from_model) * normal;
    view_position = place.xyz;
    at = texture_at;
}`;
const kFragmentShader = `#version 300 es
precision highp float;
in vec3 view_normal; in vec3 view_position; in vec2 at;
uniform vec4 colour;
uniform int mode;  // 0 lit, 1 skin, 2 textured, 3 flat
uniform sampler2D image;
out vec4 result;
void main() {
    if (mode == 3) { result = colour; return; }
    if (mode == 2) { result = vec4(mix(vec3(0.03, 0.05, 0.07), vec3(1.0), texture(image, at).rgb), colour.a); return; }
    vec3 n = normalize(view_normal), to_eye = normalize(-view_position), lamp = normalize(vec3(-0.35, 0.75, 0.6));
    float light = 0.3 + 0.7 * (0.5 + 0.5 * dot(faceforward(n, -to_eye, n), lamp));
    if (mode == 1) {
        float rim = pow(1.0 - abs(dot(n, to_eye)), 1.7);
        result = vec4(colour.rgb * (0.5 + 0.6 * light), min(colour.a + 0.72 * rim, 1.0));
    } else {
        result = vec4(colour.rgb * light + 0.18 * pow(max(dot(n, normalize(to_eye + lamp)), 0.0), 24.0), colour.a);
    }
}`;

// 4 x 4, column by column as WebGL takes it; rows: as the program gives them.
const of_rows = (rows) => Float32Array.from({length: 16}, (unused, n) => rows[4 * (n % 4) + (n >> 2)]);
function product(a, b) {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; ++c)
        for (let r = 0; r < 4; ++r)
            for (let k = 0; k < 4; ++k) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    return out;
}
const at_point = ({x, y, z}, scale) => new Float32Array([scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, x, y, z, 1]);

export class View3d {
    constructor(scan) {
        this.scan = scan;
        this.canvas = $('view3d');
        $('view3d-show').addEventListener('click', () => this.show_it(!this.on));
        $('view3d-from').addEventListener('change', () => { this.drawn_s = undefined; });
        $('view3d-home').addEventListener('click', () => this.home());
        this.canvas.addEventListener('pointermove', (e) => this.turn(e));
        this.canvas.addEventListener('pointerdown', (e) => this.canvas.setPointerCapture(e.pointerId));
        this.canvas.addEventListener('wheel', (e) => this.approach(e), {passive: false});
        this.canvas.addEventListener('keydown', (e) => this.key(e));
        this.canvas.addEventListener('webglcontextlost', () => { this.gl = null; this.show_it(false); });
    }
    get core() { return this.scan.core; }

    // Another case or exercise: its meshes are made when the view is next drawn.
    show() {
        this.core.calls.scene_end();
        this.forget();
    }
    forget() {
        for (const mesh of this.meshes ?? []) this.drop(mesh);
        this.meshes = null;
        this.orbit = null;
        this.drawn_s = undefined;
    }
    show_it(on) {
        if (on && !this.begin_gl()) {
            this.scan.notice(t('This browser draws no 3-D view: it has no WebGL2.'));
            on = false;
        }
        this.on = on;
        $('view3d-show').setAttribute('aria-expanded', String(on));
        $('view3d-room').hidden = !on;
        if (on) {
            $('view3d-room').scrollIntoView({block: 'nearest'});
        } else {
            this.forget();
            this.core.calls.scene_end();
        }
        this.scan.touched();
    }
    home() {
        this.orbit = null;
        this.drawn_s = undefined;
        this.scan.touched();
    }
    turned() {
        this.drawn_s = undefined;
        this.scan.touched();
    }
    turn(e) {
        if (!e.buttons || !this.orbit) return;
        this.orbit.yaw -= 0.008 * e.movementX;
        this.orbit.pitch = Math.min(Math.max(this.orbit.pitch + 0.008 * e.movementY, -1.5), 1.5);
        this.turned();
    }
    approach(e) {
        e.preventDefault();
        if (!this.orbit) return;
        this.orbit.distance = Math.min(Math.max(this.orbit.distance * 0.9 ** -Math.sign(e.deltaY), 150), 3000);
        this.turned();
    }
    // When the view has the focus, the arrows turn it, not the probe.
    key(e) {
        const by = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1]}[e.code];
        const nearer = {Equal: 0.9, Minus: 1 / 0.9}[e.code];
        if (!this.orbit || (!by && !nearer && e.code !== 'Home')) return;
        e.preventDefault();
        e.stopPropagation();
        if (e.code === 'Home') {
            this.home();
            return;
        }
        if (by) {
            this.orbit.yaw += by[0];
            this.orbit.pitch = Math.min(Math.max(this.orbit.pitch + by[1], -1.5), 1.5);
        } else {
            this.orbit.distance = Math.min(Math.max(this.orbit.distance * nearer, 150), 3000);
        }
        this.turned();
    }

    begin_gl() {
        if (this.gl) return true;
        const gl = this.canvas.getContext('webgl2', {antialias: true, alpha: false});
        if (!gl || gl.isContextLost()) return false;
        const program = gl.createProgram();
        for (const [kind, source] of [[gl.VERTEX_SHADER, kVertexShader], [gl.FRAGMENT_SHADER, kFragmentShader]]) {
            const shader = gl.createShader(kind);
            gl.shaderSource(shader, source);
            gl.compileShader(shader);
            gl.attachShader(program, shader);
        }
        ['position', 'normal', 'texture_at'].forEach((name, n) => gl.bindAttribLocation(program, n, name));
        gl.linkProgram(program);
        if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return false;
        gl.useProgram(program);
        this.places = Object.fromEntries(['clip_from_view', 'view_from_model', 'colour', 'mode'].map((name) => [name, gl.getUniformLocation(program, name)]));
        gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
        for (const [what, value] of [[gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE], [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR]])
            gl.texParameteri(gl.TEXTURE_2D, what, value);
        gl.cullFace(gl.BACK);
        this.gl = gl;
        return true;
    }
    // Skin and tools at once; organs, for which a torso takes half a second, after the view has been drawn.
    make_meshes() {
        const meshes = this.meshes = Array.from({length: this.core.calls.scene_parts()}, (unused, part) => this.upload(part));
        setTimeout(() => {
            if (this.meshes !== meshes || !this.gl) return;
            for (let part = meshes.length, end = this.core.calls.scene_organs(); part < end; ++part) meshes.push(this.upload(part));
            this.turned();
        });
    }
    upload(part) {
        const {gl} = this, {vertices, indices, rgb} = this.core.scene_part(part);
        const mesh = {array: gl.createVertexArray(), buffers: [gl.createBuffer(), gl.createBuffer()], count: indices.length, rgb};
        gl.bindVertexArray(mesh.array);
        gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[0]);
        gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.buffers[1]);
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
        [[3, 0], [3, 12], [2, 24]].forEach(([size, from], n) => {
            gl.enableVertexAttribArray(n);
            gl.vertexAttribPointer(n, size, gl.FLOAT, false, 32, from);
        });
        return mesh;
    }
    drop(mesh) {
        if (!this.gl) return;
        this.gl.deleteVertexArray(mesh.array);
        for (const buffer of mesh.buffers) this.gl.deleteBuffer(buffer);
    }

    // After a picture.
    picture_drawn(now_s) {
        if (!this.on || now_s - this.drawn_s < 1 / kRate || !this.canvas.checkVisibility()) return;
        this.drawn_s = now_s;
        const {gl} = this, {values} = this.scan;
        if (!this.meshes) this.make_meshes();
        this.orbit ??= this.core.scene_first();
        const plane = [values.mm_per_px, values.origin_x, values.origin_y, values.width, values.height, this.scan.flip_sign()].join();
        if (plane !== this.plane) {  // the picture lies on it in another way
            const n = kParts.indexOf('plane');
            this.drop(this.meshes[n]);
            this.meshes[n] = this.upload(n);
            this.plane = plane;
        }
        const width = Math.round(this.canvas.clientWidth * devicePixelRatio), height = Math.round(this.canvas.clientHeight * devicePixelRatio);
        if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, this.scan.picture.image);
        this.render(width, height);
    }
    render(width, height) {
        const {gl} = this, {values} = this.scan, exam = this.scan.exam(), from = Number($('view3d-from').value);
        const [view, probe, needle] = this.core.scene_places(from, this.orbit).map(of_rows);
        const aspect = width / Math.max(height, 1), tan_half = kTanHalf * Math.max(1, 1 / Math.max(aspect, 0.25));
        gl.viewport(0, 0, width, height);
        gl.depthMask(true);
        gl.clearColor(0.0627, 0.0667, 0.0706, 1);
        gl.enable(gl.DEPTH_TEST);
        gl.depthFunc(gl.LESS);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.uniformMatrix4fv(this.places.clip_from_view, false, [1 / (tan_half * aspect), 0, 0, 0, 0, 1 / tan_half, 0, 0,
            0, 0, -(kFar + kNear) / (kFar - kNear), -1, 0, 0, -2 * kFar * kNear / (kFar - kNear), 0]);
        const draw = (part, place, rgb, alpha, mode) => {
            const mesh = this.meshes[typeof part === 'number' ? part : kParts.indexOf(part)];
            gl.uniformMatrix4fv(this.places.view_from_model, false, place ? product(view, place) : view);
            gl.uniform4f(this.places.colour, (rgb >> 16) / 255, (rgb >> 8 & 255) / 255, (rgb & 255) / 255, alpha);
            gl.uniform1i(this.places.mode, mode);
            gl.bindVertexArray(mesh.array);
            gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
        };
        if (!exam) for (let n = kParts.length; n < this.meshes.length; ++n) draw(n, null, this.meshes[n].rgb, 1, 0);
        if (from !== 2) {  // the probe would stand in the way of the needle's view
            draw('probe', probe, 0xB9BEC4, 1, 0);
            draw('mark', probe, 0x4A4F55, 1, 0);
        }
        draw('plane', probe, 0x9AA3AB, 1, 2);
        if (values.has_needle) {
            draw('needle', needle, 0xF2F4F6, 1, 0);
            draw('hub', needle, 0xB9BEC4, 1, 0);
        }
        const targets = this.scan.shows_targets() ? this.core.targets().map((t) => product(probe, at_point(t, Math.max(t.radius, 3)))) : [];
        for (const target of targets) draw('ball', target, 0xFFFFFF, 1, 0);
        if (!exam) this.draw_through(draw, needle, targets);
        this.draw_skin(draw, exam);
    }
    // Needle and targets shine faintly through what is in front of them.
    draw_through(draw, needle, targets) {
        const {gl} = this;
        gl.depthFunc(gl.GREATER);
        gl.depthMask(false);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
        if (this.scan.values.has_needle) draw('needle', needle, 0xF2F4F5, 0.5, 3);
        for (const target of targets) draw('ball', target, 0xFFFFFF, 0.4, 3);
        gl.disable(gl.BLEND);
        gl.depthMask(true);
        gl.depthFunc(gl.LESS);
    }
    // Its front only, blended over what is inside. In an exam it hides what is inside.
    draw_skin(draw, exam) {
        const {gl} = this;
        gl.enable(gl.CULL_FACE);
        if (exam) {
            draw('skin', null, 0x9A8779, 1, 0);
        } else {
            gl.colorMask(false, false, false, false);
            draw('skin', null, 0xDBB8A1, 0.3, 3);  // depth alone
            gl.colorMask(true, true, true, true);
            gl.depthFunc(gl.LEQUAL);
            gl.enable(gl.BLEND);
            gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
            draw('skin', null, 0xDBB8A1, this.meshes.length > kParts.length ? 0.2 : 0.42, 1);
            gl.disable(gl.BLEND);
        }
        gl.disable(gl.CULL_FACE);
    }
}
