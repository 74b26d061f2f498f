// SPDX-License-Identifier: Apache-2.0

// Service worker: after one visit the page works without a network. The program and the page come
// from the cache and are renewed in the background of the next visit; cases are kept by source.js.
// A host may have several sites, each with its own version.
const kSite = `sonocase-page-${registration.scope} `, kCache = `${kSite}@VERSION@`;
// The program that runs here, with SIMD or without; app.js knows.
const kProgram = new URL(location.href).searchParams.get('program') ?? 'sonoplay.wasm';
const kFiles = ['./', 'index.html', 'style.css', 'sonoplay.js', kProgram, '@WORDS@'];

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

// The site's file and not what a network's sign-in page, or the host, shows in its place.
function is_good(response, name) {
    const is_page = (response.headers.get('Content-Type') ?? '').startsWith('text/html');
    return response.ok && (!is_page || /(^|\/)(index\.html)?$/.test(name));
}
// A host may let browsers keep files for a while: asked anew, a new page never gets an old program.
const from_host = (name) => fetch(new Request(name, {cache: 'no-cache'}));
async function fetch_all(cache, names) {
    const responses = await Promise.all(names.map(from_host));
    names.forEach((name, n) => { if (!is_good(responses[n], name)) throw new Error(`${name}: ${responses[n].status}`); });
    await Promise.all(names.map((name, n) => cache.put(name, responses[n])));
}

async function fill() {
    const cache = await caches.open(kCache);
    await fetch_all(cache, kFiles);
    const list = await list_of(await from_host('cases.json'), cache, 'cases.json');
    if (list?.course) await fetch_all(cache, [list.course, 'course.js']);
    // Without the pictures of its cards the page works too.
    const previews = list?.cases.map(({preview}) => preview).filter((one) => one) ?? [];
    for (const one of new Set(previews)) await fetch_all(cache, [one]).catch(() => {});
}

// The list of an answer, which is then kept; null: it is none, whoever gave it.
async function list_of(response, cache, key) {
    const list = response.ok ? await response.clone().json().catch(() => null) : null;
    if (list?.format !== 'sonocase site') return null;
    await keep(cache, key, response.clone());
    return list;
}
// Where the browser is full, the page still works with a network.
async function keep(cache, key, response) {
    await cache?.put(key, response).catch(() => {});
}

async function answer(request, url) {
    const cache = await caches.open(kCache).catch(() => undefined);
    const options = {ignoreSearch: request.mode === 'navigate'};
    const kept = () => cache?.match(request, options).catch(() => undefined);
    // The list may have new cases, and a case another picture of the same name: the network first, where there is one.
    const is_list = url.pathname.endsWith('/cases.json');
    if (is_list || url.pathname.endsWith('.png')) {
        try {
            const fresh = await fetch(request);
            if (is_list && await list_of(fresh, cache, request)) return fresh;
            if (is_list || !is_good(fresh, url.pathname)) return await kept() ?? fresh;
            await keep(cache, request, fresh.clone());
            return fresh;
        } catch {
            return await kept() ?? Response.error();
        }
    }
    const here = await kept();
    if (here) return here;
    const response = await fetch(request);
    if (is_good(response, url.pathname)) await keep(cache, request, response.clone());
    return response;
}
