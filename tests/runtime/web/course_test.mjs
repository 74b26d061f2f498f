// SPDX-License-Identifier: Apache-2.0

// course_test.mjs PROGRAM_FOLDER BIN_FOLDER: a course on the page and in its packages, in Chromium: on a site of its
// own, and opened by a platform that holds packages and page to public rules (package_rules.mjs, platform.mjs).
import {mkdirSync, readFileSync, writeFileSync} from 'node:fs';
import {createServer} from 'node:http';
import {dirname, join} from 'node:path';
import {site_server} from '../../../scripts/web-serve.mjs';
import {package_faults, read_zip} from './package_rules.mjs';
import {Cmi5Platform} from './platform.mjs';
import {Browser, expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin] = process.argv.slice(2);
const work = folder(), pictures = process.env.COURSE_PICTURES;
const case_file = join(work, 'small.sonocase'), site = join(work, 'site');
run(join(bin, 'core_write_case'), case_file, join(work, 'small.igs.mha'), 'titled');  // a course names a case, not its title
writeFileSync(join(work, 'course.toml'), `name = "First needles"
title = "First needles"
text = "Two modules, each with a gate."
[[modules]]
name = "look"
title = "Look & find"
text = "Slide until the vessel lies in the middle.\\n\\nThen hold still."
case = "cylinder"
exercise = "scan"
expert = "along"
question = "What first?"
options = ["Press", "Slide"]
answer = 1
because = "Only sliding leads to it."
practice = { measure = "probe_path_length_mm", at_most = 500 }
gate = { passes_in_a_row = 2 }
retention_days = 30
[[modules]]
name = "in plane"
title = "In plane"
text = "Now the needle."
case = "cylinder"
exercise = "scan"
gate = { passes_in_a_row = 3, steady = true }
[texts.de]
title = "Erste Nadeln"
`);
run(join(bin, 'sonocase'), 'publish', case_file, '-o', site, '--program', program, '--course', join(work, 'course.toml'), '--package', 'cmi5,scorm12,scorm2004');

// Of modules whose names are not plain: on a platform's host as well.
const far = join(work, 'far.toml');
writeFileSync(far, ['Gefäß', '针'].map((name) => `[[modules]]\nname = "${name}"\ntitle = "${name} 1"\ntext = "t"\ncase = "cylinder"\nexercise = "scan"\ngate = { passes_in_a_row = 1 }\n`)
    .join('').replace(/^/, 'name = "far"\n'));
run(join(bin, 'sonocase'), 'publish', case_file, '-o', join(work, 'far'), '--program', program, '--course', far, '--package', 'cmi5,scorm12,scorm2004');

// Packages lie unpacked on the platform's own host, where its API and its record store are.
for (const kind of ['cmi5', 'scorm12', 'scorm2004']) {
    for (const [from, folder] of [[join(site, `First-needles-${kind}.zip`), kind], [join(work, 'far', `far-${kind}.zip`), `far-${kind}`]]) {
        for (const [name, bytes] of read_zip(readFileSync(from))) {
            const file = join(work, 'platform', folder, name);
            mkdirSync(dirname(file), {recursive: true});
            writeFileSync(file, bytes);
        }
    }
}
writeFileSync(join(work, 'platform', 'platform.js'), readFileSync(new URL('platform.mjs', import.meta.url)));
writeFileSync(join(work, 'platform', 'frame.html'), '<!DOCTYPE html><title>platform</title><link rel="icon" href="data:,"><style>iframe{width:100%;height:500px}</style><iframe></iframe>');
let platform = null;
const server = await served(site_server(join(work, 'platform'), (request, response) => {
    const {pathname} = new URL(request.url, 'http://x');
    if (pathname !== '/fetch' && !pathname.startsWith('/lrs/')) return false;
    let body = '';
    request.on('data', (data) => { body += data; });
    request.on('end', () => {
        if (!platform.online) { request.socket.destroy(); return; }
        if (platform.hangs?.(request.url)) { (platform.held ??= []).push(response); return; }
        const {status, text} = platform.handle(request.method, request.url, request.headers, body);
        response.writeHead(status, {'Content-Type': 'application/json'}).end(text);
    });
    return true;
}));
const own_server = await served(site_server(site));
async function served(of) {
    // The browser opens connections ahead, and a busy machine may use one only after minutes.
    of.headersTimeout = of.requestTimeout = 0;
    await new Promise((done) => of.listen(0, '127.0.0.1', done));
    return of;
}
const address = (of) => `http://127.0.0.1:${of.address().port}/`;
// Few pictures of many pages: nothing is compiled for speed.
const browser = await Browser.start('--js-flags=--liftoff-only');

// In the page, or in the frame of a platform's page.
const text = (page, id, where = '') => page.value(`${where}document.getElementById('${id}').textContent`);
const press = (page, id, where = '') => page.value(`${where}document.getElementById('${id}').click()`);
const answer = (page, n, where = '') => page.value(`${where}document.querySelectorAll('#module .stack button')[${n}].click()`);
// An attempt that ended with these scores: through the page while it scans, else handed to the course alone, which
// saves opening the case. A real attempt has page_test.mjs.
// Several begin in one second, each in a millisecond of its own, and all of them count.
let attempts = 0;
const attempt = (page, passed, where = '') => page.value(`(async () => {
    const {app} = ${where}sonoplay, score = {passed: ${passed}, pass_marks: [], metrics: {probe_path_length_mm: 300}, warnings: []};
    app.began(Date.now() + ${++attempts});
    if (app.scan.shown()) {
        app.core.finish_attempt = () => ({recording: new Uint8Array(4), score_text: '{}', score});
        app.core.result = () => ({has_marks: true, passed: ${passed}, marks: 0, marks_reached: 0, advice: '', rows: [], measures: []});
        await app.score_attempt();
        return;
    }
    const made = {started: app.started, started_ms: app.started_ms, trainee: '', case_name: 'cylinder', exercise: 'scan', title: 'Find', passed: ${passed}, exam: false};
    app.course.takes([['completed', made, score], ['scored', made, score]]);
    app.course.attempt_done(made, score);
    app.course.show();
})()`);
const look = async (page, name) => { if (pictures) await page.picture(join(pictures, `${name}.png`)); };

await run_tests({
    packages_keep_the_public_rules() {
        for (const kind of ['cmi5', 'scorm12', 'scorm2004']) {
            const files = read_zip(readFileSync(join(site, `First-needles-${kind}.zip`)));
            expect_equal(package_faults(files, kind).join('\n'), '', kind);
            // The rules themselves: each notices what is planted.
            const name = kind === 'cmi5' ? 'cmi5.xml' : 'imsmanifest.xml', whole = files.get(name).toString('utf8');
            for (const [was, is] of kind === 'cmi5' ? [['index.html?', 'nowhere.html?'], ['masteryScore="1.0"', 'masteryScore="1.5"'], [':look"', ':in-plane"'], ['moveOn="Passed"', 'moveOn="Later"']]
                : [['href="index.html"', 'href="nowhere.html"'], ['identifier="item-look"', 'identifier="1look"'], ['identifierref="module-look"', 'identifierref="module-book"'], ['<schema>ADL', '<schema>IMS'], ['<title>', '<titel>'], ['sonoplay.wasm"', 'sonoplay.wasn"']]) {
                let noticed;
                try {
                    noticed = package_faults(new Map([...files, [name, Buffer.from(whole.replace(was, is))]]), kind).length > 0;
                } catch {
                    noticed = true;  // no longer XML
                }
                expect(whole.includes(was) && noticed, `${kind}: ${was} -> ${is} is noticed`);
            }
        }
    },
    async modules_with_names_of_any_script_are_opened_by_their_package() {
        for (const kind of ['cmi5', 'scorm12', 'scorm2004']) {
            const manifest = read_zip(readFileSync(join(work, 'far', `far-${kind}.zip`)));
            expect_equal(package_faults(manifest, kind).join('\n'), '', kind);
            const queries = [...manifest.get(kind === 'cmi5' ? 'cmi5.xml' : 'imsmanifest.xml').toString('utf8').matchAll(/\?module=[^<"]*/g)].map(([query]) => query);
            expect_equal(queries.join(), '?module=Gef----,?module=---', `${kind}: addresses`);
            for (const [n, title] of ['Gefäß 1', '针 1'].entries()) {
                if (kind !== 'cmi5' && n > 0) continue;
                const page = await browser.page(800, 600);
                await page.open(`${address(server)}far-${kind}/index.html${queries[n]}`);
                await page.until('document.getElementById("module-title")');
                expect_equal(await text(page, 'module-title'), title, kind);
                await page.close();
            }
        }
    },
    async a_site_shows_its_course_from_the_question_to_the_gate() {
        const page = await browser.page(800, 600);
        // At any hour one of these two places has another day than UTC.
        const zone = new Date().getUTCHours() < 12 ? 'Pacific/Pago_Pago' : 'Pacific/Kiritimati';
        await page.send('Emulation.setTimezoneOverride', {timezoneId: zone});
        await page.open(address(own_server));
        await page.until('!document.getElementById("course-card").hidden');
        expect((await text(page, 'course-card')).includes('Passed 0 of 2'), 'the card');
        await look(page, 'start');
        await press(page, 'open-course');
        await page.until('document.querySelectorAll("#modules button").length === 2');
        expect(!(await text(page, 'module')).includes('Slide until'), 'asked before the text');
        await answer(page, 0);
        expect((await text(page, 'module')).includes('Slide until') && (await text(page, 'module')).includes('Only sliding'), 'then the text');
        await look(page, 'course');
        await press(page, 'module-expert');
        await page.until('sonoplay.app.scan.frames > 0 && sonoplay.app.course.watched');
        const place = 'sonoplay.app.core.scene_places(0, 0, 0, 1)[1].join()', before = await page.value(place);
        await page.until(`${place} !== ${JSON.stringify(before)}`);
        await page.until('sonoplay.app.course.watched === null');  // two seconds long
        await look(page, 'expert');
        await press(page, 'end-watching');
        expect_equal(await page.value('document.getElementById("course").hidden'), false, 'back at the module');
        await press(page, 'module-begin');
        await page.until('sonoplay.app.scan.shown()');
        await attempt(page, true);
        expect((await text(page, 'after-course')).includes('Passes in a row: 1'), await text(page, 'after-course'));
        await look(page, 'after');
        await press(page, 'after-to-course');
        // Loaded again in the middle.
        await page.open(address(own_server) + '?module=look');
        await page.until('!document.getElementById("course").hidden');
        expect((await text(page, 'module')).includes('Passes in a row: 1'), 'the attempt is kept');
        expect((await text(page, 'module')).includes('last: 300'), 'and its measure');
        await page.value('document.querySelectorAll("#modules button")[1].click()');
        expect((await text(page, 'module')).includes('Locked until this is passed: Look & find'), 'the next is locked');
        await page.value('document.querySelectorAll("#modules button")[0].click()');
        await press(page, 'module-begin');
        await page.until('sonoplay.app.scan.shown()');
        await attempt(page, false);
        await attempt(page, true);
        await attempt(page, true);
        expect((await text(page, 'after-course')).includes('The gate is passed'), 'passed');
        await press(page, 'after-to-course');
        expect((await text(page, 'modules')).includes('Passed'), 'said in the list');
        const day = (add) => new Date(Date.now() + 86400e3 * add).toLocaleDateString('sv', {timeZone: zone});
        expect((await text(page, 'module')).includes(`Passed on ${day(0)}`) && (await text(page, 'module')).includes(`Due on ${day(30)}`), `the learner's own day: ${await text(page, 'module')}`);
        expect_equal(await page.value('sonoplay.app.course.kept.state("look").told'), new Date().toISOString().slice(0, 10), 'kept in UTC');
        // A second tab only watches; it goes on when the first is closed.
        const second = await browser.page(800, 600, page.context);
        await second.open(address(own_server) + '?module=in-plane');
        await second.until('document.getElementById("course-notice").textContent.includes("another tab")');
        await look(second, 'second');
        await page.close();
        await second.until('!document.getElementById("course-notice").textContent.includes("another tab")');
        expect((await text(second, 'modules')).includes('✓ Passed'), 'with what the first has done');
        await second.value('document.documentElement.lang = "de"; sonoplay.app.course.language_changed()');
        expect_equal(await text(second, 'course-title'), 'Erste Nadeln', 'in German');
        expect_equal(second.errors.join(), '', 'errors on the console');
        await second.close();
    },
    async scorm_platforms_are_told_over_reloads() {
        for (const kind of ['scorm12', 'scorm2004']) {
            const is_2004 = kind === 'scorm2004', page = await browser.page(800, 600), where = 'frames[0].';
            await page.open(`${address(server)}frame.html`);
            const launch = () => page.value(`(async () => {
                const {scorm_api} = await import('/platform.js');
                window.kept ??= new Map();
                window.${is_2004 ? 'API_1484_11' : 'API'} = window.lms = scorm_api(${is_2004}, window.kept);
                document.querySelector('iframe').src = '/${kind}/index.html?module=look';
            })()`);
            const kept = (name) => page.value(`window.kept.get('${name}') ?? ''`);
            await launch();
            await page.until(`${where}document.getElementById('module-begin')`);
            await look(page, kind);
            expect_equal(await page.value(`${where}document.getElementById('modules').hidden`), true, 'the platform leads through the course');
            await answer(page, 1, where);
            await attempt(page, true, where);
            expect_equal(await kept(is_2004 ? 'cmi.completion_status' : 'cmi.core.lesson_status'), 'incomplete', 'under way');
            // Loaded again in the middle: this platform ends the session with the page.
            if (is_2004) {
                await page.value(`${where}location.reload()`);
                await page.until('window.lms.ended === 1');
                await page.until(`${where}sonoplay?.app.course?.alone && ${where}document.getElementById('module-begin')`);
                expect((await text(page, 'course-notice', where)).includes('has closed this session'), 'said');
                expect((await text(page, 'module', where)).includes('Passes in a row: 1'), 'and kept');
            }
            const faults = await page.value('window.lms.faults.join()');
            await launch();
            await page.until(`window.lms.state === 'open' && ${where}sonoplay?.app.course?.alone`);
            expect((await text(page, 'module', where)).includes('Passes in a row: 1'), 'resumed');
            await attempt(page, true, where);
            expect_equal(await kept(is_2004 ? 'cmi.success_status' : 'cmi.core.lesson_status'), 'passed', 'pass');
            await press(page, 'course-back', where);
            await page.until('window.lms.ended === 1');
            expect_equal(faults + await page.value('window.lms.faults.join()'), '', `rules of ${kind}`);
            expect_equal(page.errors.filter((one) => !one.startsWith('Initialize')).join(), '', 'errors on the console');
            await page.close();
        }
    },
    async a_cmi5_platform_is_told_over_a_reload_and_without_network() {
        platform = new Cmi5Platform(address(server).slice(0, -1), {returnURL: `${address(server)}frame.html?back`});
        const url = `${address(server)}cmi5/index.html?module=look&${platform.launch()}`;
        const page = await browser.page(800, 600);
        await page.open(url);
        await page.until('document.querySelectorAll("#module .stack button").length === 2');
        await answer(page, 1);
        await attempt(page, true);
        // The same address in a second tab.
        const second = await browser.page(800, 600, page.context);
        await second.open(url);
        await second.until('document.getElementById("course-notice").textContent.includes("another tab")');
        await second.close();
        platform.online = false;
        await page.open(url);
        await page.until('sonoplay.app.course?.alone && !document.getElementById("course").hidden');
        expect((await text(page, 'module')).includes('Passes in a row: 1'), 'kept over a reload without the platform');
        await press(page, 'module-begin');
        await page.until('sonoplay.app.scan.shown()');
        await attempt(page, true);
        await press(page, 'after-to-course');
        expect((await text(page, 'course-notice')).includes('Not yet handed over'), 'it waits, and says so');
        await look(page, 'waits');
        platform.online = true;
        await page.value('dispatchEvent(new Event("online"))');
        await page.until('sonoplay.app.course.platform.waiting() === 0');
        const back = page.once('Page.loadEventFired');
        await press(page, 'course-back');
        await back;
        expect_equal(await page.value('location.search'), '?back', 'the way back');
        expect_equal(platform.verbs().join(), 'initialized,scored,scored,completed,passed,terminated', 'statements');
        expect_equal(platform.faults.join('\n'), '', 'rules of cmi5');
        await page.close();
    },
    async a_cmi5_platform_that_does_not_answer_keeps_nobody_waiting() {
        platform = new Cmi5Platform(address(server).slice(0, -1));
        const page = await browser.page(800, 600);
        let answers = false;
        platform.hangs = (path) => path.startsWith('/fetch') && !answers;
        await page.open(`${address(server)}cmi5/index.html?module=look&${platform.launch()}`);
        await page.until('document.querySelectorAll("#module .stack button:enabled").length === 2');
        expect((await text(page, 'course-notice')).includes('is being asked'), await text(page, 'course-notice'));
        await answer(page, 1);
        await attempt(page, true);
        await page.value('document.getElementById("module-begin").focus()');
        answers = true;
        // Sooner than the 20 s after which the page itself gives up.
        for (const response of platform.held) response.writeHead(503).end();
        await page.until('document.getElementById("course-notice").textContent.includes("does not answer")');
        await page.value('dispatchEvent(new Event("online"))');
        await page.until('sonoplay.app.course.platform.has_state && sonoplay.app.course.platform.waiting() === 0');
        await page.until('document.getElementById("course-notice").textContent === ""');
        expect_equal(platform.verbs().join(), 'initialized,scored', 'what was done meanwhile is handed over');
        expect_equal(await page.value('document.activeElement.id'), 'module-begin', 'whoever is at a button stays there');
        expect_equal(platform.faults.join('\n'), '', 'rules of cmi5');
        await page.close();
    },
    async a_package_speaks_the_language_that_its_platform_names() {
        platform = new Cmi5Platform(address(server).slice(0, -1));
        platform.documents.set('cmi5LearnerPreferences', '{"languagePreference":"de-DE,en"}');
        const page = await browser.page(800, 600), url = `${address(server)}cmi5/index.html?module=look&${platform.launch()}`;
        await page.open(url);
        // The page is loaded again, and nothing can be asked of it just then.
        const german = 'document.documentElement.lang === "de" && document.getElementById("module-begin") && sonoplay.app.course.platform.has_state';
        for (let tries = 0; tries < 5; ++tries) {
            try {
                await page.until(german);
                break;
            } catch (error) {
                if (!/navigated|context/.test(error.message)) throw error;
            }
        }
        expect_equal(await text(page, 'module-begin'), 'Üben', 'German');
        await page.until('sonoplay.app.course.platform.waiting() === 0');
        expect_equal(platform.verbs().join(), 'initialized', 'one session');
        expect_equal(platform.faults.join('\n'), '', 'rules of cmi5');
        // The learner's own choice on this page goes first.
        await page.value('localStorage.setItem("sonocase-language", "en")');
        await page.open(`${address(server)}cmi5/index.html?module=look&${platform.launch()}`);
        await page.until('document.getElementById("module-begin") && sonoplay.app.course.platform.has_state');
        expect_equal(await page.value('document.documentElement.lang'), 'en', 'English');
        await page.close();
    },
});
await browser.stop();
for (const one of [server, own_server]) { one.closeAllConnections?.(); one.close(); }
