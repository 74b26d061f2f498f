// SPDX-License-Identifier: Apache-2.0

// web-serve.mjs SITE [PORT]: serves a folder on loopback alone, for trying a site out: with byte ranges, and page and
// program compressed, as hosts do. Port 0 takes a free one; the address is printed.
import {createReadStream, readFileSync, statSync} from 'node:fs';
import {createServer} from 'node:http';
import {extname, join, normalize} from 'node:path';
import {brotliCompressSync, constants} from 'node:zlib';

const kTypes = {'.html': 'text/html; charset=utf-8', '.css': 'text/css', '.js': 'text/javascript', '.json': 'application/json',
    '.wasm': 'application/wasm', '.png': 'image/png'};

// Once for all servers of this process. quality: of brotli; 11, the best, takes 5 s for a program.
const compressed = new Map();
function brotli(file, {mtimeMs}, quality) {
    const key = `${file} ${mtimeMs} ${quality}`;
    if (!compressed.has(key))
        compressed.set(key, brotliCompressSync(readFileSync(file), {params: {[constants.BROTLI_PARAM_QUALITY]: quality}}));
    return compressed.get(key);
}

// site: a folder. before(request, response): for tests; true where it has answered itself. Returns the server; listen()
// it.
export function site_server(site, before = () => false, quality = 5) {
    return createServer((request, response) => {
        if (before(request, response)) return;
        const path = decodeURIComponent(new URL(request.url, 'http://x').pathname);
        const file = join(site, normalize(path.endsWith('/') ? `${path}index.html` : path));
        let size, state;
        try {
            if (!file.startsWith(join(site, '/')) || !(state = statSync(file)).isFile()) throw new Error();
            size = state.size;
        } catch {
            response.writeHead(404).end('not found');
            return;
        }
        const headers = {'Content-Type': kTypes[extname(file)] ?? 'application/octet-stream', 'Accept-Ranges': 'bytes',
            'Cache-Control': 'no-cache', ETag: `"${state.size}-${Math.floor(state.mtimeMs)}"`};
        if (request.headers['if-none-match'] === headers.ETag) {
            response.writeHead(304, headers).end();
            return;
        }
        const packs = /\.(html|css|js|json|wasm)$/.test(file) && /\bbr\b/.test(request.headers['accept-encoding'] ?? '');
        if (packs && size > 0) {
            const bytes = brotli(file, state, quality);
            response.writeHead(200, {...headers, 'Content-Encoding': 'br', 'Content-Length': bytes.length});
            response.end(request.method === 'HEAD' ? undefined : bytes);
            return;
        }
        const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? '');
        let start = 0, end = size - 1;
        if (range) {
            [start, end] = [Number(range[1]), Math.min(Number(range[2]), size - 1)];
            if (start > end) {
                response.writeHead(416, {'Content-Range': `bytes */${size}`}).end();
                return;
            }
            headers['Content-Range'] = `bytes ${start}-${end}/${size}`;
        }
        response.writeHead(range ? 206 : 200, {...headers, 'Content-Length': size === 0 ? 0 : end - start + 1});
        if (request.method === 'HEAD' || size === 0) response.end();
        else createReadStream(file, {start, end}).pipe(response);
    });
}

if (process.argv[1] === new URL(import.meta.url).pathname) {
    const [site, port] = process.argv.slice(2);
    const server = site_server(site);
    server.listen(Number(port ?? 8000), '127.0.0.1', () => console.log(`http://127.0.0.1:${server.address().port}/`));
}
