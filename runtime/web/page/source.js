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
    try {
        const response = await fetch_twice('cases.json', {cache: 'no-cache'}, (r) => r.ok);
        return await response.json();
    } catch (error) {
        if (error instanceof SyntaxError) throw new PlainError(t('The list of cases is damaged. Tell the site\'s owner.'));
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

export function open_bytes(core, bytes, name) {
    core.reserve(bytes.length);
    core.put(bytes, 0);
    return core.open(name);
}
