// SPDX-License-Identifier: Apache-2.0

// The picture on its canvas, and what lies over it: depth scale, mark of the probe, measurements.

import {t} from './words.js';

const kWhite = '#e6e8ea', kScaleRoom = 44;  // px beside the picture for the depth scale

export class Picture {
    constructor(box, canvas, overlay) {
        this.box = box;
        this.canvas = canvas;
        this.overlay = overlay;
        this.context = canvas.getContext('2d', {alpha: false});
        this.grey = new Uint32Array(256).map((unused, grey) => 0xff000000 | grey << 16 | grey << 8 | grey);  // of a strip
    }

    // Width and height of the picture in pixels of the screen, for the room that the page has: a fan is wider than high, and
    // fills it. At most 1024 x 1024 pixels, in steps of 32.
    wanted_size() {
        const {width, height} = this.box.getBoundingClientRect(), high = Math.max(64, height);
        const wide = Math.max(high / 2, Math.min(width - kScaleRoom, 2 * high));
        const ratio = Math.min(devicePixelRatio, 1024 / Math.sqrt(wide * high));
        const px = (css) => Math.max(256, 32 * Math.floor(css * ratio / 32));
        return {width: px(wide), height: px(high)};
    }
    // strip: part of the height, at the bottom, that is not the picture's
    place(values, strip = 0) {
        const {width, height} = this.box.getBoundingClientRect();
        this.room = (1 - strip) * height;
        this.css_per_px = Math.max(64, Math.min((width - kScaleRoom) / values.width, this.room / values.height) * values.width) / values.width;
        this.css_width = this.css_per_px * values.width;
        this.css_height = this.css_per_px * values.height;
        this.canvas.style.top = `${this.room / 2}px`;
        if (this.canvas.width !== values.width || this.canvas.height !== values.height)
            Object.assign(this.canvas, {width: values.width, height: values.height});
        this.image = this.context.createImageData(values.width, values.height);
        this.words = new Uint32Array(this.image.data.buffer);
        // The picture lies in the middle, less the room that the depth scale takes.
        this.left = Math.max(0, Math.min((width - this.css_width) / 2, width - this.css_width - kScaleRoom));
        this.canvas.style.left = `${this.left}px`;
        this.canvas.style.width = `${this.css_width}px`;
        this.canvas.style.height = `${this.css_height}px`;
        this.overlay.width = Math.round(width * devicePixelRatio);
        this.overlay.height = Math.round(height * devicePixelRatio);
        this.overlay.style.width = `${width}px`;
        this.overlay.style.height = `${height}px`;
    }

    // screen: # width * height of red, green, blue, 255; overlay: indices into colours, 0 for grey, or null
    show(screen, overlay, colours) {
        const {words} = this;
        words.set(screen);
        if (overlay) for (let n = 0; n < words.length; ++n) if (overlay[n]) words[n] = colours[overlay[n]];
        this.context.putImageData(this.image, 0, 0);
    }

    // Place in the scan plane, mm from the middle of the face, of a point of the window.
    mm_at(client_x, client_y, values) {
        const rect = this.canvas.getBoundingClientRect(), px = values.width / rect.width;
        return {x: ((client_x - rect.left) * px - values.origin_x) * values.mm_per_px,
                z: ((client_y - rect.top) * px - values.origin_y) * values.mm_per_px};
    }

    // targets: in the probe's frame, those that may be shown; name: what lies under the pointer, or null;
    // more(on): draws further marks
    // mark_mm: half of the face; cross: where keys measure, or null
    draw_over(values, flip, mark_mm, measures, first, cross, targets, name, more) {
        const to = this.overlay.getContext('2d'), ratio = devicePixelRatio;
        to.setTransform(ratio, 0, 0, ratio, 0, 0);
        const height = this.overlay.height / ratio;
        to.clearRect(0, 0, this.overlay.width / ratio, height);
        const per_mm = this.css_per_px / values.mm_per_px;
        const left = this.left, top = (this.room - this.css_height) / 2;
        const x_of = (mm) => left + values.origin_x * this.css_per_px + mm * per_mm;
        const y_of = (mm) => top + values.origin_y * this.css_per_px + mm * per_mm;
        to.font = '13px "Noto Sans", "DejaVu Sans", sans-serif';
        const line = (x0, y0, x1, y1) => {
            for (const [style, thick] of [['#000', 3], [kWhite, 1]]) {
                to.strokeStyle = style;
                to.lineWidth = thick;
                to.beginPath();
                to.moveTo(x0, y0);
                to.lineTo(x1, y1);
                to.stroke();
            }
        };
        const say = (text, x, y) => {
            to.strokeStyle = '#000';
            to.lineWidth = 3;
            to.strokeText(text, x, y);
            to.fillStyle = kWhite;
            to.fillText(text, x, y);
        };
        const scale_x = left + this.css_width + 6;
        for (let cm = 0; cm * 10 <= values.depth_mm + 0.5; ++cm) {
            const y = y_of(10 * cm), is_fifth = cm % 5 === 0;
            line(scale_x, y, scale_x + (is_fifth ? 10 : 5), y);
            if (is_fifth) say(String(cm), scale_x + 14, y + 4);
        }
        // The side of the probe's mark, a letter in a ring: beside the face, where x points, as in the window.
        const mark_x = x_of(flip * mark_mm) + flip * 20, mark_y = Math.max(y_of(0) - 2, top + 14);
        say('S', mark_x - 4, mark_y + 5);
        to.strokeStyle = kWhite;
        to.lineWidth = 1.5;
        to.beginPath();
        to.arc(mark_x, mark_y, 10, 0, 2 * Math.PI);
        to.stroke();
        measures.forEach(([a, b], n) => {
            line(x_of(flip * a.x), y_of(a.z), x_of(flip * b.x), y_of(b.z));
            const mm = Math.hypot(a.x - b.x, a.z - b.z);
            say(`${n + 1}: ${mm.toFixed(1)} mm`, left + 8, top + this.css_height - 10 - 18 * (measures.length - 1 - n));
        });
        for (const {x, y, z, radius} of targets) {
            if (z <= 0) continue;
            const off = Math.abs(y), cut = off < radius;
            to.setLineDash(cut ? [] : [2, 5]);
            for (const [style, thick] of [['#000', 4], [kWhite, 2]]) {
                to.strokeStyle = style;
                to.lineWidth = thick;
                to.beginPath();
                to.arc(x_of(flip * x), y_of(z), per_mm * (cut ? Math.sqrt(radius ** 2 - off ** 2) : radius), 0, 2 * Math.PI);
                to.stroke();
            }
            to.setLineDash([]);
            if (!cut) say(t('%.0f mm off the plane', off), x_of(flip * x) + per_mm * radius + 6, y_of(z) + 4);
        }
        if (name) {
            const rect = this.box.getBoundingClientRect();
            const wide = to.measureText(name.words).width;
            say(name.words, Math.min(name.x - rect.left + 16, rect.width - wide - 4), Math.min(name.y - rect.top + 24, height - 6));
        }
        more({to, x_of, y_of, line, say, flip, height});
        if (first) line(x_of(flip * first.x) - 5, y_of(first.z), x_of(flip * first.x) + 5, y_of(first.z));
        if (!cross) return;
        const cross_x = x_of(flip * cross.x), cross_y = y_of(cross.z);
        line(cross_x - 9, cross_y, cross_x + 9, cross_y);
        line(cross_x, cross_y - 9, cross_x, cross_y + 9);
        if (first) say(`${Math.hypot(first.x - cross.x, first.z - cross.z).toFixed(1)} mm`, cross_x + 12, cross_y - 8);
    }
}
