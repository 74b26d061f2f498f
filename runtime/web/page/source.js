// SPDX-License-Identifier: Apache-2.0

// Bytes of cases: from the site, from a file, or from the page itself.
import {PlainError} from './core.js';

const kCache = 'sonocase-cases-1';

// Cache storage where the browser gives it (not from file://, not in some private windows).
async function open_cache() {
    try {
        return await globalThis.caches?.open(kCache);
    } catch {
        return undefined;
    }
}

function lost(error) {
    if (error.name === 'AbortError' || error instanceof PlainError) return error;
    return new PlainError('The connection was lost. Check the network and try again.');
}

// Fetches with one more try, as a connection may break once. good(response) says what is accepted.
async function fetch_twice(url, options, good) {
    for (let attempt = 0;; ++attempt) {
        try {
            const response = await fetch(url, options);
            if (good(response)) return response;
            if (response.status < 500 || attempt > 0)
                throw new PlainError(`The server answered ${response.status} for ${url}. Tell the site's owner.`);
        } catch (error) {
            if (attempt > 0 || error.name === 'AbortError' || error instanceof PlainError) throw lost(error);
        }
    }
}

// The site's list of cases (docs/browser.md).
export async function load_list() {
    const inside = document.getElementById('site-list');
    if (inside) return JSON.parse(inside.textContent);
    try {
        const response = await fetch_twice('cases.json', {cache: 'no-cache'}, (r) => r.ok);
        return await response.json();
    } catch (error) {
        if (error instanceof SyntaxError) throw new PlainError('The list of cases is damaged. Tell the site\'s owner.');
        throw error;
    }
}

function from_base64(text) {
    const plain = atob(text);
    const bytes = new Uint8Array(plain.length);
    for (let n = 0; n < plain.length; ++n) bytes[n] = plain.charCodeAt(n);
    return bytes;
}
// The bytes of an element of a single-file page; null: the page has no such element.
export function inside_page(id) {
    const element = document.getElementById(id);
    return element ? from_base64(element.textContent.trim()) : null;
}

// Streams a whole case into the program. entry: of the site's list; progress(0..1).
async function load_whole(core, entry, progress, signal) {
    const cache = await open_cache();
    const key = `${entry.file}?digest=${entry.digest}`;
    const kept = await cache?.match(key);
    const response = kept ?? await fetch_twice(entry.file, {signal}, (r) => r.ok);
    core.reserve(entry.bytes);
    let at = 0;
    const parts = [];
    const reader = response.body.getReader();
    try {
        for (;;) {
            const {done, value} = await reader.read();
            if (done) break;
            if (at + value.length > entry.bytes)
                throw new PlainError(`${entry.title} is longer than the list says. Tell the site's owner.`);
            core.put(value, at);
            if (cache && !kept) parts.push(value);
            at += value.length;
            progress(at / entry.bytes);
        }
    } catch (error) {
        throw lost(error);
    }
    if (at !== entry.bytes) throw new PlainError(`${entry.title} arrived cut short. Try again.`);
    if (core.digest_of(0, at) !== entry.digest) {
        await cache?.delete(key);
        throw new PlainError(`${entry.title} is damaged. Its checksum differs. Try again.`);
    }
    if (cache && !kept) await keep(cache, key, parts);
}

async function keep(cache, key, parts) {
    try {
        await cache.put(key, new Response(new Blob(parts)));
    } catch {
        // No room: the case is fetched again the next time.
    }
}

// Fills the program with a case of the site and opens it; returns its description.
export async function open_entry(core, entry, progress, signal) {
    const inside = inside_page(`case-${entry.name}`);
    if (inside) return open_bytes(core, inside, entry.title);
    await load_whole(core, entry, progress, signal);
    return core.open(entry.title);
}

export function open_bytes(core, bytes, name) {
    core.reserve(bytes.length);
    core.put(bytes, 0);
    return core.open(name);
}
