// SPDX-License-Identifier: Apache-2.0

// What this page's own trackers have in common (camera.js, usb.js): a room on the page, and that their world is laid on the
// case's mannequin. tools: [{status, rows, sigma_mm}] of probe and needle, status as put_tools() takes it.
import {element} from './scan.js';
import {t} from './words.js';

// Products and inverses of poses: 16 numbers, rows.
export function pose_times(a, b) {
    return Array.from({length: 16}, (unused, n) => [0, 1, 2, 3].reduce((sum, k) => sum + a[(n & ~3) + k] * b[4 * k + (n & 3)], 0));
}
export function pose_inverse(a) {
    const out = [a[0], a[4], a[8], 0, a[1], a[5], a[9], 0, a[2], a[6], a[10], 0, 0, 0, 0, 1];
    for (let r = 0; r < 3; ++r) out[4 * r + 3] = -(out[4 * r] * a[3] + out[4 * r + 1] * a[7] + out[4 * r + 2] * a[11]);
    return out;
}

export class PlacedTracker {
    // room: the element to fill. ended(): it stops by itself, after words. name: in recordings (kTrackers of core.js).
    constructor(scan, room, ended, name) {
        Object.assign(this, {scan, room, ended, name, newest: null, placed: null, said_above: '', missed: 0});
    }
    // What every room has; third: the name of a third value, beside the states of both tools. file, about_file: of a button.
    common_parts(third, file_name, about_file) {
        this.words = element('p', '', {className: 'second'});
        this.words.setAttribute('role', 'status');
        const list = element('dl', '', {className: 'values'});
        const [probe, needle, delay] = [t('Probe'), t('Needle'), third].map((name) => {
            const value = element('dd', '–');
            list.append(element('dt', name), value);
            return value;
        });
        Object.assign(this, {states: [probe, needle], delay});
        const place = element('button', t('Probe is at the start'), {type: 'button', title: t('Hold the probe where the exercise begins; the picture goes there')});
        place.addEventListener('click', () => this.place());
        const file = element('input', '', {type: 'file', accept: '.json', hidden: true});
        file.setAttribute('aria-label', file_name);
        file.addEventListener('change', () => this.use_file(file.files[0]));
        const ask = element('button', file_name, {type: 'button', title: about_file});
        ask.addEventListener('click', () => file.click());
        const row = element('div', '', {className: 'row'});
        row.append(place, ask, file);
        return [list, this.words, row];
    }
    say(words) { if (this.words.textContent !== words) this.words.textContent = words; }
    // Above the picture, where a trainee looks.
    say_above(words) {
        if (words === this.said_above) return;
        this.said_above = words;
        this.scan.tracker_says(words);
    }
    // A sentence of the program: its format and its words, each a text or such a list again.
    said_by_program(sentence) {
        if (!sentence) return '';
        return Array.isArray(sentence) ? t(sentence[0], ...sentence.slice(1).map((word) => this.said_by_program(word))) : t(sentence);
    }
    show_states() {
        const kStates = {good: t('Good'), poor: t('Poor'), lost: t('Lost'), absent: '–'};
        this.newest.tools.forEach(({status, sigma_mm}, n) => {
            const words = sigma_mm === undefined || status === 'lost' ? kStates[status] : `${kStates[status]} · ${sigma_mm.toFixed(1)} mm`;
            if (this.states[n].textContent !== words) this.states[n].textContent = words;
        });
    }

    // A case's mannequin lies where the probe was when it was said to be at the start.
    is_placed() { return this.placed?.case_name === this.scan.description.case_name; }
    place() {
        const probe = this.newest?.tools[0];
        if (probe?.status !== 'good') {
            this.say(this.not_good_words());
            return;
        }
        this.placed = {case_name: this.scan.description.case_name, mannequin_from_world: pose_times(this.scan.core.probe_home(), pose_inverse(probe.rows))};
        this.newest.fresh = true;
        this.scan.touched();
    }
    place_words() { return this.is_placed() ? '' : t('Hold the probe where the exercise begins, then press the button below.'); }
    // As PoseSource: the newest poses since the last call; null: none have come, or it is not known where they are.
    take() {
        if (!this.newest?.fresh || !this.is_placed()) return null;
        this.newest.fresh = false;
        const [probe, needle] = this.newest.tools;
        const at = ({rows}) => (this.placed ? pose_times(this.placed.mannequin_from_world, rows) : rows);
        return {probe: at(probe), needle: at(needle), states: [probe.status, needle.status], tracker: this.name};
    }
}
