// SPDX-License-Identifier: Apache-2.0

// Service worker: after one visit the page works without a network. The program and the page come
// from the cache and are renewed in the background of the next visit; cases are kept by source.js.
// A host may have several sites, each with its own version.
const kSite = `sonocase-page-${registration.scope} `, kCache = `${kSite}@VERSION@`;
const kFiles = ['./', 'index.html', 'style.css', 'sonoplay.js', 'sonoplay.wasm', '@WORDS@', 'cases.json'];

addEventListener('install', (e) => {
    skipWaiting();
    e.waitUntil(fill());
});
addEventListener('activate', (e) => e.waitUntil((async () => {
    for (const name of await caches.keys()) {
        if (name.startsWith(kSite) && name !== kCache) await caches.delete(name);
    }
    await clients.claim();
})()));
addEventListener('fetch', (e) => {
    const url = new URL(e.request.url);
    if (e.request.method !== 'GET' || url.origin !== location.origin || url.pathname.endsWith('.sonocase')) return;
    e.respondWith(answer(e.request, url));
});

async function fill() {
    const cache = await caches.open(kCache);
    await cache.addAll(kFiles);
    const {course} = await (await cache.match('cases.json')).json();
    if (course) await cache.addAll([course, 'course.js']);
}

async function answer(request, url) {
    const cache = await caches.open(kCache);
    const options = {ignoreSearch: request.mode === 'navigate'};
    // The list may have new cases: the network first, where there is one.
    if (url.pathname.endsWith('/cases.json')) {
        try {
            const fresh = await fetch(request);
            if (fresh.ok) await cache.put(request, fresh.clone());
            return fresh;
        } catch {
            return await cache.match(request) ?? Response.error();
        }
    }
    const kept = await cache.match(request, options);
    if (kept) return kept;
    const response = await fetch(request);
    if (response.ok) await cache.put(request, response.clone());
    return response;
}
