// SPDX-License-Identifier: Apache-2.0

// Bytes of cases: from the site, from a file, or from the page itself.
import {PlainError} from './core.js';
import {t} from './words.js';

// Where parts of cases are kept: cache storage, where the browser gives it (not from file://, not in some private
// windows).
export async function case_cache() {
    try {
        return await globalThis.caches?.open('sonocase-cases-2');
    } catch {
        return undefined;
    }
}

export class LostConnection extends PlainError {}
export function lost(error) {
    if (error.name === 'AbortError' || error instanceof PlainError) return error;
    return new LostConnection(t('The connection was lost. Check the network and try again.'));
}

// Fetches with one more try, as a connection may break once. good(response) says what is accepted.
export async function fetch_twice(url, options, good) {
    for (let attempt = 0;; ++attempt) {
        try {
            const response = await fetch(url, options);
            if (good(response)) return response;
            if (response.status < 500 || attempt > 0)
                throw new PlainError(t('The server answered {} for {}. Tell the site\'s owner.', response.status, url));
        } catch (error) {
            if (attempt > 0 || error.name === 'AbortError' || error instanceof PlainError) throw lost(error);
        }
    }
}

// The site's list of cases (docs/browser.md).
export async function load_list() {
    const inside = document.getElementById('site-list');
    if (inside) return JSON.parse(inside.textContent);
    const response = await fetch_twice('cases.json', {cache: 'no-cache'}, (r) => r.ok);
    const list = await response.json().catch(() => null);
    if (!Array.isArray(list?.cases)) throw new PlainError(t('The list of cases is damaged. Tell the site\'s owner.'));
    return list;
}
// Room for others: parts of cases that this site no longer has. Other sites of this host keep theirs.
export async function forget_other_cases(entries) {
    try {
        const cache = entries.length && await case_cache();
        if (!cache) return;
        const here = new URL('.', location.href).href;
        const used = new Set(entries.flatMap((one) => [`${one.file}?digest=${one.digest}`, `${one.segments}?digest=${one.segments_digest}`]));
        for (const {url} of await cache.keys()) {
            const name = url.startsWith(here) ? url.slice(here.length) : '/';
            if (!name.split('?')[0].includes('/') && !used.has(name.split('&')[0])) await cache.delete(url);
        }
    } catch {
        // They stay, then.
    }
}

const kCaseBegins = [0x89, 0x53, 0x4f, 0x4e, 0x4f, 0x0d, 0x0a, 0x1a];
// By its first bytes.
export const is_case = (bytes) => kCaseBegins.every((byte, n) => bytes[n] === byte);

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

export function open_bytes(core, bytes, name) {
    core.reserve(bytes.length);
    core.put(bytes, 0);
    return core.open(name);
}
