// SPDX-License-Identifier: Apache-2.0

// poses_test.mjs PROGRAM_FOLDER BIN_FOLDER: `sonoplay --serve-poses` with node's own WebSocket (--experimental-websocket
// before node 22) and with a page in Chromium.
import {spawn} from 'node:child_process';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {site_server} from '../../../scripts/web-serve.mjs';
import {Browser, expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin] = process.argv.slice(2);
const {parse_poses} = await import(pathToFileURL(join(new URL('.', import.meta.url).pathname, '../../../runtime/web/page/poses.js')));
const work = folder(), case_file = join(work, 'small.sonocase'), session_file = join(work, 'small.igs.mha');
run(join(bin, 'core_write_case'), case_file, session_file);
const wanted = JSON.parse(run(join(bin, 'web_oracle'), 'frames', case_file, session_file, 'paper', '64'));

// A player that goes through the session's poses, and the address that it prints.
async function start_player() {
    const player = spawn(join(bin, 'sonoplay'), [case_file, '--headless', '--frames', '100000', '--size', '64x64', '--model', 'paper',
        '--tracker', `replay:${session_file}`, '--serve-poses', '0'], {stdio: ['ignore', 'pipe', 'inherit']});
    player.ended = new Promise((done) => player.once('exit', done));
    let said = '';
    player.url = await new Promise((done, failed) => {
        player.stdout.on('data', (data) => {
            said += data;
            const url = /ws:\S+/.exec(said);
            if (url) done(url[0]);
        });
        player.once('exit', () => failed(new Error(`sonoplay ended: ${said}`)));
    });
    return player;
}
async function stop(player) {
    player.kill();
    await player.ended;
}
const is_known = (poses) => wanted.some((frame) => frame.probe.every((x, n) => x === poses.probe[n]));

await run_tests({
    async nodes_own_client_gets_the_poses_of_the_session() {
        const player = await start_player(), socket = new WebSocket(player.url);
        const texts = await new Promise((done, failed) => {
            const heard = [];
            socket.onmessage = (e) => { heard.push(e.data); if (heard.length === 20) done(heard); };
            socket.onerror = socket.onclose = () => failed(new Error('closed'));
        });
        const closed = new Promise((done) => { socket.onclose = socket.onerror = done; });
        socket.close();
        await closed;
        for (const text of texts) {
            const poses = parse_poses(text);
            expect(poses && is_known(poses), text);
            expect(poses.needle?.length === 16, 'with a needle');
        }
        await stop(player);
    },
    async nobody_else_gets_them() {
        const player = await start_player();
        for (const url of [player.url.replace(/.$/, (c) => (c === '0' ? '1' : '0')), player.url.replace(/\?.*/, '')]) {
            const socket = new WebSocket(url);
            const heard = await new Promise((done) => {
                socket.onmessage = () => done('a pose');
                socket.onerror = socket.onclose = () => done('nothing');
            });
            expect_equal(heard, 'nothing', url);
        }
        const response = await fetch(player.url.replace('ws:', 'http:'));
        expect_equal(response.status, 400, 'a request that is no WebSocket');
        await stop(player);
    },
    async what_is_no_pose_is_ignored() {
        const rows = Array.from({length: 16}, (unused, n) => n);
        for (const text of ['', '{', 'null', '[]', '{}', JSON.stringify({probe: rows}), JSON.stringify({probe: rows.slice(1), needle: null}),
            JSON.stringify({probe: rows.with(3, null), needle: null}), JSON.stringify({probe: rows, needle: [1]})])
            expect_equal(parse_poses(text), null, text);
        expect_equal(parse_poses(JSON.stringify({time_s: 1, probe: rows, needle: null})).probe.join(), rows.join(), 'a pose');
    },
    async a_page_follows_the_tracker() {
        const player = await start_player(), site = join(work, 'site');
        run(join(bin, 'sonocase'), 'publish', case_file, '-o', site, '--program', program, '--poses', player.url);
        const server = site_server(site);
        await new Promise((done) => server.listen(0, '127.0.0.1', done));
        const browser = await Browser.start(), page = await browser.page();
        await page.open(`http://127.0.0.1:${server.address().port}/?case=small&poses=${encodeURIComponent(player.url)}`);
        await page.until('sonoplay.app.scan.frames > 0');
        await page.value(`(() => {
            const {core} = sonoplay.app, put = core.put_tools;
            globalThis.taken = [];
            core.put_tools = (now_s, probe, needle) => { taken.push({probe, needle}); put.call(core, now_s, probe, needle); };
        })()`);
        await page.until('taken.length > 10 && sonoplay.app.scan.values.has_needle');
        for (const poses of await page.value('taken')) expect(is_known(poses), 'a pose of the session');
        expect_equal(await page.value('document.getElementById("bar-notice").textContent'), '', 'words while it is there');
        await stop(player);
        await page.until('document.getElementById("bar-notice").textContent.includes("No tracker answers")');
        const before = await page.value('sonoplay.app.scan.frames');
        await page.until(`sonoplay.app.scan.frames > ${before} + 2`);
        expect_equal(page.errors.filter((one) => /Content Security/.test(one)).join(), '', 'the policy allows it');
        await browser.stop();
        server.closeAllConnections?.();
        server.close();
    },
});
