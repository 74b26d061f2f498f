// SPDX-License-Identifier: Apache-2.0

// A case of the site that arrives in segments: what a picture needs first, the rest behind it. Every segment is checked
// before it is used; groups of them are kept in the browser's cache storage.
import {PlainError} from './core.js';
import {LostConnection, case_cache, fetch_twice, lost} from './source.js';
import {t} from './words.js';

const kGroup = 256;    // segments that are kept under one key
const kAhead = 128;    // segments that are fetched ahead at a time
const kRequests = 2;   // that fetch ahead at the same time
const kLongestWaitMs = 15000;
const kWarmUp = 60;    // pictures

// The server sends the whole file where a part was asked for.
class NoRanges extends Error {}
class Damaged extends PlainError {}

export class ArrivingCase {
    // program: promise of the Core; entry: of the site's list; changed(): called when something has arrived or cannot
    constructor(program, entry, changed) {
        Object.assign(this, {program, entry, changed, size: entry.segment_bytes, trouble: '', looked: new Map(), early: new Map(), in_flight: 0, urgent: 0, tries: 0});
        this.count = Math.ceil(entry.bytes / this.size);
        this.here = new Uint8Array(this.count);
        this.left = this.count;
        this.stopping = new AbortController();
        this.whole = new Promise((done, failed) => Object.assign(this, {done, failed}));
        this.whole.catch(() => {});  // whoever waits for it hears of it
        addEventListener('online', () => this.wake?.(), {signal: this.stopping.signal});
    }
    stop() {
        this.stopping.abort();
        this.failed(new DOMException('stopped', 'AbortError'));
    }
    get part() { return 1 - this.left / this.count; }
    get busy() { return this.left > 0 && !this.stopping.signal.aborted; }

    // Room in the program, the list of hashes, and what must be there before the case can be opened.
    async begin(progress) {
        const {entry} = this, signal = this.stopping.signal;
        const wanted = [...new Set(entry.first.flatMap(([at, bytes]) =>
            segments_from(Math.floor(at / this.size), Math.ceil((at + bytes) / this.size))))];
        this.cache = await case_cache();
        const groups = [...new Set(wanted.map((n) => Math.floor(n / kGroup)))];
        // What is kept is read while the program is still on its way.
        this.reading = new Map(groups.map((group) => [group, this.read_kept(this.key(group))]));
        this.reading_hashes = this.read_kept(this.hashes_key());
        await this.ask_early(groups[0], runs_of(wanted));
        const core = this.core = await this.program;
        if (signal.aborted) throw new DOMException('stopped', 'AbortError');
        core.calls.prepare();
        const hashes = await this.hashes();
        core.reserve(entry.bytes);
        this.at = core.case_at;
        core.begin_segments(this.size, hashes);
        const lacking = new Set(wanted);
        const enough = new Promise((done) => {
            this.on_segment = (segment) => {
                if (!lacking.delete(segment)) return;
                progress(1 - lacking.size / wanted.length);
                if (lacking.size === 0) done();
            };
        });
        await Promise.all(groups.map((group) => this.from_cache(group)));
        if (lacking.size > 0) this.warm_up(() => lacking.size / wanted.length);
        try {
            await Promise.all(runs_of(wanted.filter((n) => !this.here[n])).map((run) => this.fetch_run(run)));
        } catch (error) {
            if (!(error instanceof NoRanges)) throw lost(error);
            this.stream();
            await Promise.race([enough, this.streaming]).catch((failure) => { throw lost(failure); });
        }
        if (signal.aborted) throw new DOMException('stopped', 'AbortError');
        this.on_segment = undefined;
    }
    // A browser compiles for speed what it has seen run: pictures of the program's own small case, while the real one
    // is on its way; and that is opened as far as it goes, once half of it is here.
    async warm_up(lacking) {
        const {calls} = this.core;
        let rehearsed = false;
        for (let n = 0; n < kWarmUp || !rehearsed; ++n) {
            await new Promise((done) => setTimeout(done, 10));
            if (!lacking() || this.stopping.signal.aborted) break;
            if (n < kWarmUp) calls.warm_up(n);
            if (rehearsed || lacking() > 0.5) continue;
            calls.rehearse();
            rehearsed = true;
        }
        calls.warm_up(-1);
    }
    // While the program is still on its way, so that the link is never idle.
    async ask_early(group, runs) {
        const {entry} = this;
        if (await this.reading.get(group)) return;
        const ask = (url, options) => {
            const answer = fetch(url, {signal: this.stopping.signal, ...options});
            answer.catch(() => {});  // whoever takes it hears of it
            this.early.set(url + (options.headers?.Range ?? ''), answer);
        };
        ask(entry.segments, {});
        for (const {first, count} of runs) ask(entry.file, {headers: {Range: this.range_of(first, count)}, cache: 'no-store'});
    }
    // fetch(), or the answer that was asked for early.
    get(url, options) {
        const key = url + (options.headers?.Range ?? ''), early = this.early.get(key);
        this.early.delete(key);
        return early ?? fetch(url, options);
    }
    range_of(first, count) {
        return `bytes=${first * this.size}-${Math.min((first + count) * this.size, this.entry.bytes) - 1}`;
    }
    async hashes() {
        const {entry} = this, core = this.core;
        const good = (bytes) => {
            core.reserve(bytes.length);
            core.put(bytes, 0);
            return bytes.length === 8 * this.count && core.digest_of(0, bytes.length) === entry.segments_digest;
        };
        const kept = await this.reading_hashes;
        if (kept && good(new Uint8Array(kept))) return new Uint8Array(kept);
        for (const cache of ['default', 'reload']) {
            const early = await this.early.get(entry.segments)?.catch(() => undefined);
            this.early.delete(entry.segments);
            const response = early?.ok ? early
                : await fetch_twice(entry.segments, {signal: this.stopping.signal, cache}, (r) => r.ok);
            const bytes = new Uint8Array(await response.arrayBuffer().catch((error) => { throw lost(error); }));
            if (!good(bytes)) continue;
            await this.cache?.put(this.hashes_key(), new Response(bytes)).catch(() => {});
            return bytes;
        }
        throw new PlainError(t('{} is damaged on the server: its list of segments is wrong. Tell the site\'s owner.', entry.title));
    }

    // True: the segment's bytes are those of the case. They lie in the program's memory already.
    settle(segment) {
        if (this.here[segment]) return true;
        if (!this.core.calls.arrive(segment)) return false;
        this.here[segment] = 1;
        --this.left;
        this.on_segment?.(segment);
        if (!this.filling) this.keep(Math.floor(segment / kGroup));
        return true;
    }
    write(bytes, at) {
        new Uint8Array(this.core.memory.buffer).set(bytes, this.at + at);
    }

    key(group) { return `${this.entry.file}?digest=${this.entry.digest}&group=${group}`; }
    hashes_key() { return `${this.entry.segments}?digest=${this.entry.segments_digest}`; }
    // The bytes under a key of the cache; undefined where there are none, or the cache fails.
    async read_kept(key) {
        try {
            return await (await this.cache?.match(key))?.arrayBuffer();
        } catch {
            return undefined;
        }
    }
    // A group that is kept; what of it is not right is fetched again.
    from_cache(group) {
        if (!this.looked.has(group)) this.looked.set(group, this.take_kept(group));
        return this.looked.get(group);
    }
    async take_kept(group) {
        try {
            const kept = await (this.reading.get(group) ?? this.read_kept(this.key(group)));
            this.reading.delete(group);
            if (!kept) return;
            const bytes = new Uint8Array(kept), from = group * kGroup;
            if (this.stopping.signal.aborted) return;
            let good = bytes.length === Math.min(kGroup * this.size, this.entry.bytes - from * this.size);
            this.filling = true;
            for (let n = from; n < Math.min(from + kGroup, this.count) && good; ++n) {
                if (this.here[n]) continue;
                this.write(bytes.subarray((n - from) * this.size, (n - from + 1) * this.size), n * this.size);
                good = this.settle(n);
            }
            this.filling = false;
            if (!good) await this.cache.delete(this.key(group));
        } catch {
            this.filling = false;  // the cache fails: the network has it
        }
    }
    // Keeps a group once it is whole.
    keep(group) {
        const from = group * kGroup, to = Math.min(from + kGroup, this.count);
        for (let n = from; n < to; ++n) if (!this.here[n]) return;
        const bytes = new Uint8Array(this.core.memory.buffer, this.at + from * this.size,
            Math.min((to - from) * this.size, this.entry.bytes - from * this.size)).slice();
        this.keeping = Promise.resolve(this.keeping).then(() => this.cache?.put(this.key(group), new Response(bytes))).catch(() => {});
    }

    // Segments as their bytes come. first: the segment with which the stream begins. Returns those that were wrong.
    async take(response, first, end_at) {
        const wrong = [], reader = response.body.getReader();
        let at = first * this.size, next = first;
        for (;;) {
            const {done, value} = await reader.read();
            if (done) break;
            if (at + value.length > end_at) {
                reader.cancel().catch(() => {});
                throw new PlainError(t('{} is longer than the list says. Tell the site\'s owner.', this.entry.title));
            }
            // What is there already is left alone: the program reads it.
            for (let from = 0; from < value.length;) {
                const segment = Math.floor((at + from) / this.size);
                const count = Math.min(value.length - from, (segment + 1) * this.size - at - from);
                if (!this.here[segment]) this.write(value.subarray(from, from + count), at + from);
                from += count;
            }
            at += value.length;
            for (; next < this.count && Math.min((next + 1) * this.size, this.entry.bytes) <= at; ++next)
                if (!this.settle(next)) wrong.push(next);
        }
        return {wrong, at};
    }

    async fetch_run({first, count}, again = false) {
        const {entry} = this, from = first * this.size, to = Math.min((first + count) * this.size, entry.bytes);
        const response = await this.get(entry.file, {headers: {Range: this.range_of(first, count)},
            signal: this.stopping.signal, cache: again ? 'reload' : 'no-store'});
        const range = /^bytes (\d+)-(\d+)\/(\d+|\*)$/.exec(response.headers.get('Content-Range') ?? '');
        if (response.status === 200 || (response.status === 206 && !range)) {
            response.body.cancel().catch(() => {});
            throw new NoRanges();
        }
        if (response.status >= 500) throw new TypeError(`answer ${response.status}`);  // may pass
        if (response.status !== 206) throw new PlainError(t('The server answered {} for {}. Tell the site\'s owner.', response.status, entry.file));
        if (range[3] !== '*' && Number(range[3]) !== entry.bytes) {
            response.body.cancel().catch(() => {});
            throw new PlainError(t('{} has another length on the server than the list says. Load the page again.', entry.title));
        }
        if (Number(range[1]) !== from || Number(range[2]) !== to - 1) {
            response.body.cancel().catch(() => {});
            throw new NoRanges();
        }
        const {wrong, at} = await this.take(response, first, to);
        if (at < to) throw new TypeError('the answer ended early');  // as a connection that breaks
        if (!wrong.length) return;
        if (again) throw new Damaged(`${entry.title} is damaged: a checksum differs. Load the page again, or tell the site's owner.`);
        for (const run of runs_of(wrong)) await this.fetch_run(run, true);
    }

    // The whole file in one answer, for a server without ranges; what is there already is passed over.
    async fetch_all() {
        const {entry} = this;
        const response = await fetch_twice(entry.file, {signal: this.stopping.signal, cache: 'reload'}, (r) => r.ok);
        const {wrong, at} = await this.take(response, 0, entry.bytes);
        if (at < entry.bytes) throw new PlainError(t('{} arrived cut short. Try again.', entry.title));
        if (wrong.length) throw new Damaged(`${entry.title} is damaged: a checksum differs. Try again.`);
    }

    stream() {
        this.streaming = this.fetch_all();
        this.streaming.catch(() => {});  // begin() or follow_stream() hears of it
    }

    // Fetches what the last picture lacked, then what lies ahead. Once the case is open and a picture has been drawn.
    pump() {
        if (this.waiting || this.settled || this.stopping.signal.aborted) return;
        if (this.left === 0) {
            this.look();
            return;
        }
        if (this.streaming) {
            this.follow_stream();
            return;
        }
        const lacking = this.core.values().missing > 0 ? this.core.next_runs(0) : [];
        for (const run of lacking) this.start(run, true);
        if (this.urgent > 0 || this.in_flight >= kRequests) return;
        for (const run of this.core.next_runs(kAhead)) this.start(run, false);
    }
    async start(run, urgent) {
        ++this.in_flight;
        if (urgent) ++this.urgent;
        try {
            for (let g = Math.floor(run.first / kGroup); g <= Math.floor((run.first + run.count - 1) / kGroup); ++g) await this.from_cache(g);
            for (const part of runs_of(segments_from(run.first, run.first + run.count).filter((n) => !this.here[n])))
                await this.fetch_run(part);
            this.tries = 0;
            this.trouble = '';
        } catch (error) {
            this.core.calls.ask_again(run.first, run.count);
            await this.fail(error);
        } finally {
            --this.in_flight;
            if (urgent) --this.urgent;
        }
        this.look();
    }
    // What has come shows in the next picture.
    look() {
        if (this.stopping.signal.aborted) return;
        try {
            this.core.look_again();
        } catch (error) {
            this.trouble = error.message;
        }
        this.changed();
        if (this.left > 0) {
            this.pump();
            return;
        }
        this.settled = true;
        this.trouble = '';
        Promise.resolve(this.keeping).then(() => this.done());
    }
    // A server without ranges sends everything in its order: shown as it comes.
    async follow_stream() {
        if (this.following) return;
        this.following = true;
        this.on_segment = () => { if (this.left % kAhead === 0) this.look(); };
        try {
            await this.streaming;
        } catch (error) {
            this.streaming = undefined;
            await this.fail(error);
            if (this.busy) this.stream();
        }
        this.following = false;
        this.look();
    }
    // After a failure: says what is missing, and waits longer each time; a new connection ends the wait.
    async fail(error) {
        if (error.name === 'AbortError' || this.stopping.signal.aborted) return;
        if (error instanceof NoRanges) {
            if (!this.streaming) this.stream();
            return;
        }
        const here = t('%d %% of the case is here, the rest of it is shown with less structure.', Math.floor(100 * this.part));
        if (error instanceof PlainError && !(error instanceof LostConnection)) {
            this.trouble = `${error.message} ${here}`;
            this.stopping.abort();
            this.failed(error);
            this.changed();
            return;
        }
        this.trouble = `${t('No connection')}: ${here}`;
        this.changed();
        this.waiting ??= new Promise((done) => {
            this.wake = done;
            setTimeout(done, Math.min(500 * 2 ** this.tries++, kLongestWaitMs));
        }).then(() => { this.waiting = undefined; });
        await this.waiting;
    }
}

function segments_from(first, end) {
    return Array.from({length: end - first}, (unused, n) => first + n);
}
// Neighbouring numbers as runs; rising order.
export function runs_of(segments) {
    const out = [];
    for (const n of segments) {
        const last = out.at(-1);
        if (last && last.first + last.count === n) ++last.count;
        else out.push({first: n, count: 1});
    }
    return out;
}
