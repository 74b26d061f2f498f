// SPDX-License-Identifier: Apache-2.0

// page_test.mjs PROGRAM_FOLDER BIN_FOLDER: the published site in Chromium, driven by injected input.
import {readFileSync, writeFileSync} from 'node:fs';
import {createServer} from 'node:http';
import {join} from 'node:path';
import {site_server} from '../../../scripts/web-serve.mjs';
import {Browser, cook_draft, expect, expect_equal, folder, run, run_tests} from './support.mjs';

const [program, bin] = process.argv.slice(2);
const work = folder();
const case_file = join(work, 'small.sonocase'), session_file = join(work, 'small.igs.mha'), site = join(work, 'site');
run(join(bin, 'core_write_case'), case_file, session_file, 'flow');
run(join(bin, 'sonocase'), 'publish', case_file, '-o', site, '--program', program);

async function serve(of) {
    const started = site_server(of);
    await new Promise((done) => started.listen(0, '127.0.0.1', done));
    return [started, `http://127.0.0.1:${started.address().port}/`];
}
const [server, url] = await serve(site);
const browser = await Browser.start('--enable-unsafe-swiftshader');
const kFrames = 'sonoplay.app.scan.frames';

async function scanning(page, query = '?case=small&exercise=scan') {
    await page.open(url + query);
    await page.until(`${kFrames} > 0`);
    expect_equal(page.errors.join(), '', 'errors on the console');
}
const seconds_attempt = 'sonoplay.app.scan.values.seconds';

await run_tests({
    async shows_the_cases_and_opens_one_by_keyboard() {
        const page = await browser.page();
        await page.open(url);
        await page.until('document.querySelectorAll("#cases button").length === 1 && sonoplay.app.ready');
        for (let presses = 0; await page.value('!document.activeElement.closest("#cases")'); ++presses) {
            expect(presses < 20, 'a case is reached by Tab');
            await page.key('Tab');
        }
        await page.key('Enter');
        await page.until(`${kFrames} > 3`);
        expect(await page.value('sonoplay.frame().pixels.some((grey) => grey > 100)'), 'there is a picture');
        await page.close();
    },
    async pixels_in_the_browser_are_the_desktops() {
        const page = await browser.page();
        await scanning(page);
        for (const model of ['paper', 'physical']) {
            const wanted = JSON.parse(run(join(bin, 'web_oracle'), 'frames', case_file, session_file, model, '512'));
            const digests = await page.value(`(async () => {
                const {core, scan} = sonoplay.app;
                scan.hide();
                core.choose_exercise(0, 512);
                core.set_image({model_paper: ${model === 'paper'}, width: 512, height: 512, depth_mm: 0, focus_mm: 0});
                core.set_console({gain_db: 0, range_db: 60, tgc_db: new Array(8).fill(0), flip: false});
                const out = [];
                for (const frame of ${JSON.stringify(wanted.map(({time_s, probe, needle}) => ({time_s, probe, needle})))}) {
                    core.put_tools(frame.time_s, frame.probe, frame.needle);
                    core.calls.frame(frame.time_s);
                    const pixels = sonoplay.frame().pixels;
                    core.reserve(pixels.length);
                    core.put(pixels, 0);
                    out.push(core.digest_of(0, pixels.length));
                }
                return out;
            })()`);
            expect_equal(digests.join(), wanted.map((frame) => frame.digest).join(), model);
            expect(wanted.length >= 60, '60 frames');
        }
        await page.close();
    },
    async an_attempt_by_injected_input_has_the_scores_of_the_desktops_replay() {
        const page = await browser.page();
        await scanning(page);
        await page.value('document.getElementById("trainee").value = "somebody"');
        await page.key('KeyB');
        await page.until('sonoplay.app.scan.values.attempt');
        await page.key('KeyN');
        await page.until('sonoplay.app.scan.values.has_needle');
        await page.key('KeyW', 0, 'down');
        await page.until('sonoplay.app.scan.values.needle_depth_mm > 30');
        await page.key('KeyW', 0, 'up');
        await page.key('ArrowRight', 0, 'down');
        await page.until(`${seconds_attempt} > 5.2`);
        await page.key('ArrowRight', 0, 'up');
        await page.key('KeyB');
        await page.until('!document.getElementById("after").hidden');
        const {recording, text} = await page.value('({recording: [...sonoplay.app.attempt.recording], text: sonoplay.app.attempt.score_text})');
        const file = join(work, 'attempt.igs.mha');
        writeFileSync(file, Buffer.from(recording));
        expect_equal(text, run(join(bin, 'web_oracle'), 'score', case_file, file), 'scores');
        expect(JSON.parse(text).insertions.length === 1, 'one insertion');
        // The attempt's pictures again, from its beginning on, and back to its page.
        await page.click('replay');
        await page.until('sonoplay.app.scan.replays && document.getElementById("cine-words").textContent === "Replay 0:00"');
        await page.until('document.getElementById("cine-words").textContent === "Replay 0:01"');
        await page.click('to-results');
        expect(await page.value('document.getElementById("scan").hidden && !document.getElementById("after").hidden'), 'back at the results');
        // Kept for the next visit.
        await page.until('sonoplay.app.settled === sonoplay.app.started');
        await page.click('after-cases');
        // The case's card says how the trainee stands.
        const {passed, metrics} = JSON.parse(text);
        const best = metrics.final_tip_to_target_mm === null ? '' : ` · best ${metrics.final_tip_to_target_mm.toFixed(1)} mm`;
        await page.until(`document.querySelector("#cases button").textContent.endsWith(${JSON.stringify((passed ? 'Passed 1 of 1' : 'Not passed in 1') + best)})`, 20);
        await page.click('open-scores');
        await page.until('document.querySelectorAll("#attempts tr").length === 1');
        await page.close();
    },
    async practice_gives_hints_and_the_distance_and_an_exam_neither() {
        const page = await browser.page();
        await scanning(page);
        await page.value('sonoplay.app.description.exercises[0].hints = ["Look for the vessel.", "It is round."]');
        const hint = 'document.getElementById("hint").textContent', tip = 'document.getElementById("value-tip").textContent';
        for (const words of ['Hint 1 of 2: Look for the vessel.', 'Hint 2 of 2: It is round.', 'The target is shown.', 'The target is shown.']) {
            await page.key('KeyH');
            await page.until(`${hint} === ${JSON.stringify(words)}`);
        }
        expect_equal(await page.value('sonoplay.app.scan.hints'), 3, 'hints used, however often the key is pressed');
        await page.key('KeyN');
        await page.key('KeyB');
        await page.until(`sonoplay.app.scan.values.attempt && ${tip}.includes('mm')`);
        await page.value('sonoplay.app.core.calls.drop_attempt()');
        await page.until('!document.getElementById("mode").disabled');
        await page.value('document.getElementById("mode").value = "exam"');
        await page.key('KeyB');
        await page.until(`sonoplay.app.scan.values.attempt && ${hint} === ''`);
        await page.key('KeyH');
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 2`);
        expect_equal(await page.value(hint), '', 'no hint in an exam');
        expect_equal(await page.value(tip), '–', 'no distance in an exam');
        await page.close();
    },
    async an_exam_ends_when_it_is_meant_to_and_counts_when_it_is_left() {
        const page = await browser.page();
        await scanning(page);
        const text = (id) => page.value(`document.getElementById("${id}").textContent`), asked = 'document.getElementById("ask").open';
        const exam = async () => {
            await page.value('document.getElementById("mode").value = "exam"');
            await page.key('KeyB');
            await page.until(`${seconds_attempt} > 5.2`);
        };
        await exam();
        await page.key('KeyB');
        await page.until(asked);
        expect_equal(await text('ask-words'), 'End this exam? It is scored as it is.', 'asked');
        await page.click('ask-no');
        await page.until(`!${asked} && ${seconds_attempt} > ${await page.value(seconds_attempt)}`);
        await page.key('KeyB');
        await page.until(asked);
        await page.click('ask-yes');
        await page.until('!document.getElementById("after").hidden && sonoplay.app.settled === sonoplay.app.started');
        await page.click('again');
        await page.until('!document.getElementById("scan").hidden');
        expect_equal(await page.value('document.getElementById("mode").value'), 'exam', 'an exam again');
        // Left for the cases: scored, and its result is shown.
        await exam();
        await page.click('to-cases');
        await page.until(asked);
        expect_equal(await text('ask-words'), 'Leave the exam? It ends as it is, and it counts.', 'asked');
        await page.click('ask-yes');
        await page.until('!document.getElementById("after").hidden && sonoplay.app.settled === sonoplay.app.started');
        await page.click('after-cases');
        await page.until('document.querySelector("#cases button").textContent.includes("2 of 2")');
        // Left for another exercise, here the same one again: scored, and said there.
        await page.value('document.querySelector("#cases button").click()');
        await page.until(`sonoplay.app.scan.shown()`);
        await exam();
        await page.key('F5');
        await page.until(asked);
        await page.click('ask-yes');
        await page.until('document.getElementById("bar-notice").textContent.startsWith("The exam was scored: ")');
        expect_equal(await page.value('sonoplay.app.scan.shown() && sonoplay.app.scan.values.attempt'), 0, 'the exercise is open');
        // To load the page again loses an attempt, and is asked for.
        await page.key('KeyB');
        await page.until(`${seconds_attempt} > 0.1`);
        await page.open(`${url}?case=small`);
        expect_equal(page.dialogs.join(), 'beforeunload', 'asked');
        await page.until(`${kFrames} > 0`);
        await page.open(url);
        expect_equal(page.dialogs.join(), 'beforeunload', 'without an attempt it is not');
        expect_equal(page.errors.join(), '', 'errors on the console');
        await page.close();
    },
    async a_file_dropped_in_an_attempt_asks_first_and_one_that_is_no_case_leaves_it_alone() {
        const page = await browser.page();
        await scanning(page);
        const bytes = [...readFileSync(case_file)], bar = 'document.getElementById("bar-notice").textContent', asked = 'document.getElementById("ask").open';
        const drop = (content, name) => page.value(`(() => {
            const dropped = new DataTransfer();
            dropped.items.add(new File([new Uint8Array(${JSON.stringify(content)})], '${name}'));
            dispatchEvent(new DragEvent('drop', {dataTransfer: dropped}));
        })()`);
        const goes_on = async () => page.until(`${kFrames} > ${await page.value(kFrames)} + 3 && sonoplay.app.scan.values.attempt === 1`);
        await page.key('KeyB');
        await page.until(`${seconds_attempt} > 0.5`);
        await drop([...Buffer.from('holiday'.repeat(20000))], 'letter.pdf');
        await page.until(`${bar}.includes('letter.pdf')`);
        await goes_on();
        await drop(bytes, 'other.sonocase');
        await page.until(asked);
        expect_equal(await page.value('sonoplay.app.may_leave()'), false, 'one question at a time');
        await page.click('ask-no');
        await goes_on();
        expect_equal(await page.value('document.getElementById("case-title").textContent'), await page.value('sonoplay.app.description.title'), 'the case stays');
        await page.until(`${seconds_attempt} > 5.2`);
        await page.key('KeyB');
        await page.until('!document.getElementById("after").hidden');
        await page.click('again');
        // Damaged behind its first bytes: the attempt was left, the exercise stays.
        await page.key('KeyB');
        await page.until(`${seconds_attempt} > 0.1`);
        await drop(bytes.slice(0, 5000), 'cut.sonocase');
        await page.until(asked);
        await page.click('ask-yes');
        await page.until(`${bar}.includes('cut.sonocase') && sonoplay.app.scan.values.attempt === 0`);
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 3`);
        // A good one opens.
        await page.key('KeyB');
        await page.until('sonoplay.app.scan.values.attempt === 1');
        await drop(bytes, 'other.sonocase');
        await page.until(asked);
        await page.click('ask-yes');
        await page.until('sonoplay.app.scan.values.attempt === 0 && sonoplay.app.arriving_case === null');
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 3`);
        await page.close();
    },
    async a_tab_in_the_background_does_not_spend_the_time_of_an_attempt() {
        const page = await browser.page();
        await scanning(page);
        await page.key('KeyB');
        await page.until(`${seconds_attempt} > 0.5`);
        const seconds = await page.value(`(async () => {
            const {scan} = sonoplay.app, hide = (hidden) => {
                Object.defineProperty(document, 'visibilityState', {value: hidden ? 'hidden' : 'visible', configurable: true});
                document.dispatchEvent(new Event('visibilitychange'));
            };
            const {tick} = scan, before = scan.values.seconds, next = () => new Promise((done) => setTimeout(done, 50));
            // No pictures for 2 s, as in a tab that nobody sees.
            hide(true);
            scan.tick = () => {};
            await new Promise((done) => setTimeout(done, 2000));
            hide(false);
            scan.tick = tick;
            scan.tick(performance.now());
            const hidden = scan.values.seconds - before;
            // Nor while an attempt waits for the rest of its case.
            scan.held = true;
            await new Promise((done) => setTimeout(done, 2000));
            const held_from = scan.values.seconds;
            scan.held = false;
            for (let n = 0; n < 60 && scan.values.seconds === held_from; ++n) await next();
            return {hidden, held: scan.values.seconds - held_from};
        })()`);
        expect(seconds.hidden < 1.5, `hidden: ${seconds.hidden} s`);
        expect(seconds.held < 1.5, `held: ${seconds.held} s`);
        await page.close();
    },
    async a_damaged_record_and_another_trainees_do_not_disturb_and_times_are_local() {
        const page = await browser.page();
        await page.send('Emulation.setTimezoneOverride', {timezoneId: 'Australia/Sydney'});
        await page.open(url);
        await page.until('sonoplay.app.ready');
        await page.value(`new Promise((done) => {
            const opening = indexedDB.open('sonocase');
            opening.onsuccess = () => {
                const on = opening.result.transaction('attempts', 'readwrite'), to = on.objectStore('attempts');
                const one = {case_name: sonoplay.app.list.cases[0].case ?? sonoplay.app.list.cases[0].title, exercise: 'scan', title: 'As it was called', passed: true, started: '2026-01-31T12:00:00Z', recording: new Uint8Array([1, 2, 3])};
                to.add({...one, trainee: 'Ada', score_text: '{"metrics":{}}'});
                to.add({...one, score_text: '{"metr'});
                to.add({score_text: '{}'});
                on.oncomplete = () => { opening.result.close(); done(); };
            };
        })`);
        const standing = 'document.querySelector("#cases button").textContent';
        await page.open(`${url}?lang=de`);
        await page.until(`sonoplay.app.ready && ${standing}.includes("Nicht versucht")`);
        await page.click('open-scores');
        await page.until('document.querySelectorAll("#attempts tr").length === 3');
        const title = await page.value('sonoplay.app.list.cases[0].exercises[0].title');
        const cells = await page.value('[...document.querySelectorAll("#attempts tr:last-child td")].map((one) => one.textContent)');
        expect_equal(cells.slice(0, 2).join(), '2026-01-31 23:00,Ada', 'local time, and whose');
        expect_equal(cells[3], title, 'the title of the list');
        const saved = await page.value(`(async () => {
            let saved;
            sonoplay.app.save = (attempt) => { saved = attempt; };
            await sonoplay.app.save_kept(sonoplay.app.kept[0], 'recording');
            return [...saved.recording];
        })()`);
        expect_equal(saved.join(), '1,2,3', 'its recording');
        for (const left of [2, 1]) {
            await page.value('[...document.querySelectorAll("#attempts tr")].find((one) => one.textContent.includes("Beschädigt")).querySelector("button").click()');
            await page.until(`document.querySelectorAll("#attempts tr").length === ${left}`);
        }
        await page.value('(() => { const of = document.getElementById("trainee"); of.value = "Ada"; of.dispatchEvent(new Event("change")); })()');
        await page.click('scores-back');
        await page.until(`${standing}.includes("Bestanden")`);
        // What the browser clears is not there, and is kept again from then on.
        await page.send('Storage.clearDataForOrigin', {origin: url.replace(/\/$/, ''), storageTypes: 'indexeddb'});
        await page.click('open-scores');
        await page.until('document.querySelectorAll("#attempts tr").length === 0');
        await page.until('document.getElementById("scores-words").textContent === "Noch kein Versuch."');
        expect_equal(await page.value('[...sonoplay.words.missing].join(" | ")'), '', 'words without German');
        expect_equal(page.errors.join(), '', 'errors on the console');
        await page.close();
    },
    async an_attempt_without_room_is_said_and_stays_in_the_page() {
        const page = await browser.page();
        await scanning(page);
        // As a full browser has it: requests succeed, and the transaction does not.
        await page.value(`(() => {
            const {add} = IDBObjectStore.prototype;
            IDBObjectStore.prototype.add = function (row) {
                const asked = add.call(this, row);
                queueMicrotask(() => asked.addEventListener('success', () => asked.transaction.abort()));  // behind the page's own
                return asked;
            };
        })()`);
        await page.key('KeyB');
        await page.until(`${seconds_attempt} > 5.2`);
        await page.key('KeyB');
        await page.until('document.getElementById("after-notice").textContent.includes("keeps nothing: save recording and scores now")');
        await page.click('after-cases');
        await page.until('document.querySelector("#cases button").textContent.includes("1")');
        await page.click('open-scores');
        await page.until('document.querySelectorAll("#attempts tr").length === 1');
        expect((await page.value('document.getElementById("scores-words").textContent')).includes('in this page alone'), 'said here too');
        await page.close();
    },
    async an_older_page_in_another_tab_leaves_the_new_one_its_cases() {
        const old = await browser.page(), page = await browser.page(1280, 720, old.context);
        await old.open(`${url}words-de.json`);
        await old.value(`new Promise((done) => {
            const opening = indexedDB.open('sonocase', 2);
            opening.onupgradeneeded = () => {
                opening.result.createObjectStore('attempts', {keyPath: 'id', autoIncrement: true});
                opening.result.createObjectStore('statements', {keyPath: 'key', autoIncrement: true});
            };
            opening.onsuccess = () => { globalThis.kept_open = opening.result; done(); };
        })`);
        await page.open(url);
        const notice = 'document.getElementById("notice").textContent';
        await page.until(`sonoplay.app.ready && document.querySelectorAll("#cases button").length === 1 && ${notice}.includes("older page")`);
        await old.close();
        await page.until(`!${notice}.includes("older page")`);
        await page.close();
    },
    async numbers_between_the_steps_a_resting_finger_and_measuring_by_keys() {
        const page = await browser.page();
        await scanning(page);
        const values = 'sonoplay.app.scan.values';
        for (const [id, number] of [['gain', 3.4], ['range', 62], ['depth', 12.5], ['focus', 4.2]])
            await page.value(`(() => { const of = document.getElementById('${id}'); of.value = ${number}; of.dispatchEvent(new Event('change')); })()`);
        expect_equal(await page.value(`[sonoplay.app.scan.console.gain_db, sonoplay.app.scan.console.range_db, ${values}.depth_mm, ${values}.focus_mm].join()`), '3.4,62,125,42', 'taken');
        expect_equal(await page.value('document.getElementById("bar-notice").textContent'), '', 'nothing to say');
        await page.value('(() => { const of = document.getElementById("depth"); of.value = 99; of.dispatchEvent(new Event("change")); })()');
        expect((await page.value('document.getElementById("bar-notice").textContent')).includes('from 3 to 30'), 'out of range');
        // A cross that arrows move; Enter sets both points.
        await page.value('document.getElementById("picture").focus()');
        const before = await page.value('sonoplay.app.core.calls.hands_pose() && sonoplay.frame().pixels.length');
        await page.key('KeyM');
        await page.key('Enter');
        expect_equal(await page.value('sonoplay.app.scan.first_point'), null, 'no point without a cross');
        const move = async (code, until) => {
            await page.key(code, 0, 'down');
            await page.until(until);
            await page.key(code, 0, 'up');
        };
        await move('ArrowDown', 'sonoplay.app.scan.cross?.z > 65');
        await page.key('Enter');
        const first = await page.value('sonoplay.app.scan.first_point');
        await move('ArrowRight', `sonoplay.app.scan.cross.x > ${first.x} + 5`);
        await page.key('Enter');
        const [[a, b]] = await page.value('sonoplay.app.scan.measures');
        expect(Math.abs(a.z - b.z) < 1e-9 && b.x > a.x + 5, 'a line across');
        await page.key('KeyM');
        expect_equal(await page.value('sonoplay.app.scan.cross'), null, 'no cross afterwards');
        expect(before > 0, 'a picture');
        // A finger that rests on the picture leaves a needle that is in.
        await page.key('KeyN');
        await move('KeyW', `${values}.needle_depth_mm > 20`);
        const {x, y} = await page.value('(({left, top, width, height}) => ({x: left + 0.35 * width, y: top + 0.5 * height}))(document.getElementById("picture").getBoundingClientRect())');
        await page.value('sonoplay.app.scan.needle_to = () => { globalThis.aimed = true; }');
        const rest = async (seconds) => {
            await page.send('Input.dispatchTouchEvent', {type: 'touchStart', touchPoints: [{x, y}]});
            await new Promise((done) => setTimeout(done, 1000 * seconds));
            await page.send('Input.dispatchTouchEvent', {type: 'touchEnd', touchPoints: []});
        };
        await rest(0.9);
        expect_equal(await page.value('globalThis.aimed ?? false'), false, 'it stays');
        await move('KeyS', `${values}.needle_depth_mm < 0`);
        await rest(0.9);
        await page.until('globalThis.aimed');
        await page.close();
    },
    async help_begins_with_its_heading_and_names_this_keyboards_keys() {
        const page = await browser.page(1280, 600);
        await page.send('Page.enable');
        await page.send('Page.addScriptToEvaluateOnNewDocument', {source: `Object.defineProperty(navigator, 'keyboard', {value: {getLayoutMap: async () =>
            new Map([['KeyZ', 'y'], ['KeyY', 'z'], ['KeyA', 'a'], ['BracketLeft', 'ü'], ['Minus', 'ß'], ['KeyM', 'µ'], ['KeyW', 'w']])}});`});
        await scanning(page);
        await page.key('F1');
        await page.until('document.getElementById("help").open');
        const keys = await page.value('[...document.querySelectorAll("#help dt")].map((one) => one.textContent).join("|")');
        for (const words of ['A D Y X, Shift + drag', '|Ü ] ; \'|ß =|', '|N, Shift + N|', ', . P']) expect(keys.includes(words), `${words} in ${keys}`);
        expect_equal(await page.value('document.getElementById("measure").title'), 'Two clicks, or arrow keys and Enter; C clears (Μ)', 'a tip');
        expect(await page.value('document.getElementById("help-title").getBoundingClientRect().top >= 0 && document.getElementById("help").scrollTop === 0'), 'its heading is in view');
        await page.close();
    },
    async events_are_said_in_the_language_in_use() {
        const page = await browser.page();
        await scanning(page, '?case=small&exercise=scan&lang=de');
        const said = await page.value(`(() => {
            const {scan} = sonoplay.app, {labels} = scan.description;
            labels.push({name: 'kidney_left', english: 'left kidney', words: 'Kidney', side: 'left', number: ''});
            const lines = [['Insertion {}', ['2']], ['Needle out, was {} mm deep', ['31']], ['Reached: {}', ['target {}', ['2']]], ['Seen: {}', ['Zyste']],
                ['Touched: {}', ['left kidney']], ['Left: {}', ['a structure']], ['Needle lost'], ['Probe lost'], ['Done: {}', ['numbed']], ['Complication']];
            return lines.map((line) => scan.words_of_event(line)).join('|');
        })()`);
        expect(said.startsWith('Einstich 2|Nadel draußen, war 31 mm tief|Erreicht: Ziel 2|Gesehen: Zyste|Berührt: '), said);
        expect(said.endsWith('|Getan: numbed|Komplikation'), said);
        expect(!/kidney|structure|lost/i.test(said), said);
        await page.close();
    },
    async without_its_script_the_page_says_why() {
        const page = await browser.page();
        const notice = 'document.getElementById("notice").innerText';
        await page.open(`file://${site}/index.html`);
        await page.until(`${notice}.includes("--single-file") && ${notice}.includes("Diese Seite ist nicht gestartet") && getComputedStyle(document.getElementById("notice")).visibility === "visible"`);
        await page.open(url);
        await page.until(`sonoplay.app.ready && ${notice} === ""`);
        await page.close();
    },
    async results_fit_a_narrow_phone_in_both_languages() {
        for (const lang of ['en', 'de']) {
            const page = await browser.page(360, 640);
            Object.assign(page, {mobile: true, ratio: 2});
            await scanning(page, `?case=small&exercise=scan&lang=${lang}`);
            await page.key('KeyB');
            await page.until(`${seconds_attempt} > 5.2`);
            await page.key('KeyB');
            await page.until('!document.getElementById("after").hidden && sonoplay.app.settled === sonoplay.app.started');
            await page.value(`sonoplay.app.show_checklist({items: [{name: 'a', title: 'Hautdesinfektion mit Einwirkzeit abgewartet', critical: true, ticked: false, time_s: 61, why: 'too_early'}], points: 1, max_points: 2, cut: 1, stray_acts: 0, stray_acts_at_most: 3, complications: []}, {})`);
            const out = (table) => page.value(`(() => {
                const cells = [...document.querySelectorAll('#${table} td')].filter((one) => one.textContent);
                return cells.length ? cells.filter((one) => { const {left, right} = one.getBoundingClientRect(); return left < 0 || right > 360 || one.scrollWidth > one.clientWidth + 1; }).map((one) => one.textContent).join() : 'empty';
            })()`);
            for (const table of ['marks', 'checklist']) expect_equal(await out(table), '', `${lang}: ${table}`);
            await page.click('after-cases');
            await page.click('open-scores');
            await page.until('document.querySelectorAll("#attempts tr").length === 1');
            expect_equal(await out('attempts'), '', `${lang}: attempts`);
            expect(await page.value('document.documentElement.scrollWidth <= innerWidth'), `${lang}: no sideways scrolling`);
            await page.close();
        }
    },
    async a_second_attempt_shows_the_trend_and_a_button_sets_the_gain() {
        const page = await browser.page();
        await scanning(page);
        await page.value('sonoplay.app.scan.set_console({gain_db: 28})');
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 2`);
        await page.click('auto');
        expect(await page.value('sonoplay.app.scan.console.gain_db < 28 && Number(document.getElementById("gain").value) < 28'), 'darker');
        for (const attempts of [1, 2]) {
            await page.key('KeyB');
            await page.until(`sonoplay.app.scan.values.attempt && ${seconds_attempt} > 5.2`);
            await page.key('KeyB');
            await page.until('!document.getElementById("after").hidden && sonoplay.app.settled === sonoplay.app.started');
            // Of what was measured in both.
            await page.value('sonoplay.app.show_trend({metric: "elapsed_time_s", title: "Total time", limit: 4})');
            expect_equal(await page.value('document.getElementById("trend-box").hidden'), attempts === 1, 'a trend has two');
            if (attempts === 1) await page.click('again');
            await page.until(`document.getElementById("scan").hidden === ${attempts === 2}`);
        }
        expect_equal(await page.value('document.querySelectorAll("#trend circle").length'), 2, 'attempts');
        expect(await page.value('document.querySelector("#trend .limit") !== null'), 'the mark');
        await page.close();
    },
    async a_signed_case_says_by_whom_and_a_changed_one_that_it_was_changed() {
        const key = join(work, 'anna.pem'), signed = join(work, 'signed.sonocase'), its_site = join(work, 'signed');
        run(join(bin, 'sonocase'), 'key', 'Anna <Weber>', '-o', key);
        run(join(bin, 'sonocase'), 'sign', case_file, '--key', key, '-o', signed);
        const fingerprint = /fingerprint ([0-9a-f ]{39})/.exec(run(join(bin, 'sonocase'), 'inspect', signed))[1];
        run(join(bin, 'sonocase'), 'publish', signed, '-o', its_site, '--program', program);
        const [its_server, its_url] = await serve(its_site);
        const page = await browser.page(), said = 'document.getElementById("signed").textContent';
        await page.open(`${its_url}?case=signed&exercise=scan`);
        await page.until(`${said} !== ""`);
        expect_equal(await page.value(said), `Signed by Anna <Weber> (key ${fingerprint}).`, 'signed');
        // The same signature on a case of which a byte is another one, its checksums mended by packing it again.
        const changed = join(work, 'changed.sonocase');
        run(join(bin, 'web_oracle'), 'change', signed, changed);
        const bytes = readFileSync(changed).toString('base64');
        await page.value(`sonoplay.app.open_file(new File([Uint8Array.from(atob("${bytes}"), (one) => one.charCodeAt(0))], 'changed.sonocase'))`);
        await page.until(`${said}.startsWith("The signature of Anna <Weber> (key ${fingerprint}) does not fit")`);
        // A case without one says nothing, also after one that has.
        const plain = readFileSync(case_file).toString('base64');
        await page.value(`sonoplay.app.open_file(new File([Uint8Array.from(atob("${plain}"), (one) => one.charCodeAt(0))], 'plain.sonocase'))`);
        await page.until('sonoplay.app.scan.signature?.fit === "none"');
        expect_equal(await page.value(said), '', 'unsigned');
        expect_equal(page.errors.join(), '', 'errors on the console');
        await page.close();
        its_server.closeAllConnections?.();
        its_server.close();
    },
    async mouse_and_fingers_move_the_probe() {
        const page = await browser.page();
        await scanning(page);
        const pixels = () => page.value('sonoplay.frame().pixels.reduce((sum, grey, n) => (sum + grey * (n % 997)) % 1e9, 0)');
        const {x, y} = await page.value('(({left, top, width, height}) => ({x: left + width / 2, y: top + height / 2}))(document.getElementById("picture").getBoundingClientRect())');
        const before = await pixels();
        await page.send('Input.dispatchMouseEvent', {type: 'mousePressed', x, y, button: 'left', buttons: 1, clickCount: 1});
        await page.send('Input.dispatchMouseEvent', {type: 'mouseMoved', x: x + 60, y: y + 40, button: 'left', buttons: 1});
        await page.send('Input.dispatchMouseEvent', {type: 'mouseReleased', x: x + 60, y: y + 40, button: 'left', clickCount: 1});
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 1`);
        expect(await pixels() !== before, 'a drag of the mouse slides');
        const touch = (type, ...points) => page.send('Input.dispatchTouchEvent', {type, touchPoints: points.map(([px, py], id) => ({x: px, y: py, id}))});
        // A long press brings the needle; nothing moves meanwhile.
        await touch('touchStart', [x, y + 40]);
        await page.until('sonoplay.app.scan.values.has_needle');
        await touch('touchEnd');
        const tilted = await pixels();
        await touch('touchStart', [x - 40, y], [x + 40, y]);
        await touch('touchMove', [x - 40, y + 30], [x + 40, y + 30]);
        await touch('touchEnd');
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 1`);
        expect(await pixels() !== tilted, 'two fingers tilt');
        await page.close();
    },
    async doppler_modes_are_switched_aimed_dragged_and_recorded() {
        const page = await browser.page();
        await scanning(page);
        const doppler = 'sonoplay.app.core.doppler()', kShift = 8;
        await page.value('sonoplay.app.core.calls.turn(1.57)');
        await page.key('KeyB');
        await page.until('sonoplay.app.scan.values.attempt');
        await page.key('Digit2', kShift);
        await page.until('!document.getElementById("doppler").hidden && sonoplay.app.core.overlay()?.some((index) => index > 0)');
        expect(await page.value(`(() => {
            const canvas = document.getElementById('picture'), {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            for (let n = 0; n < data.length; n += 4) if (Math.abs(data[n] - data[n + 2]) > 60) return true;
        })()`), 'there is colour on the canvas');
        // The box follows the mouse, and the probe stays.
        const before = await page.value(doppler), {x, y} = await page.value(`(() => {
            const {core, scan} = sonoplay.app, points = core.doppler_marks(), r = document.getElementById('picture').getBoundingClientRect(), v = scan.values;
            const middle = points.reduce((sum, p) => ({x: sum.x + p.x / points.length, z: sum.z + p.z / points.length}), {x: 0, z: 0});
            const of = (mm, origin) => (mm / v.mm_per_px + origin) * r.width / v.width;
            return {x: r.left + of(middle.x, v.origin_x), y: r.top + of(middle.z, v.origin_y)};
        })()`);
        await page.send('Input.dispatchMouseEvent', {type: 'mousePressed', x, y, button: 'left', buttons: 1, clickCount: 1});
        await page.send('Input.dispatchMouseEvent', {type: 'mouseMoved', x, y: y + 30, button: 'left', buttons: 1});
        await page.send('Input.dispatchMouseEvent', {type: 'mouseReleased', x, y: y + 30, button: 'left', clickCount: 1});
        await page.until(`${doppler}.box_top_mm > ${before.box_top_mm} + 1`);
        const after = await page.value(doppler);
        expect(Math.abs((after.box_bottom_mm - after.box_top_mm) - (before.box_bottom_mm - before.box_top_mm)) < 1e-9, 'in its size');
        // Its controls by keyboard; each is named (the test of names looks at them in this mode too).
        await page.value('document.getElementById("d-scale").value = 50; document.getElementById("d-scale").dispatchEvent(new Event("change"))');
        expect_equal((await page.value(doppler)).scale_cm_s, 50, 'scale');
        await page.key('Digit3', kShift);
        await page.until('!document.getElementById("strip").hidden && sonoplay.app.scan.values.beats > 0', 30);
        await page.until('document.getElementById("doppler-words").textContent.includes("PSV")');
        await page.click('d-sound');
        await page.until('sonoplay.app.scan.doppler.audio.next_s > 0');
        await page.key('Digit4', kShift);
        await page.until('document.getElementById("doppler-words").textContent.includes("Depth over time")');
        await page.until(`${seconds_attempt} > 5.2`);
        await page.key('Digit1', kShift);
        await page.until('document.getElementById("doppler").hidden && document.getElementById("strip").hidden');
        await page.key('KeyB');
        await page.until('!document.getElementById("after").hidden');
        const {recording, text} = await page.value('({recording: [...sonoplay.app.attempt.recording], text: sonoplay.app.attempt.score_text})');
        const file = join(work, 'doppler.igs.mha');
        writeFileSync(file, Buffer.from(recording));
        expect(Buffer.from(recording).includes('vessel'), 'the recording names the vessel');
        expect_equal(text, run(join(bin, 'web_oracle'), 'score', case_file, file), 'scores');
        expect_equal(page.errors.join(), '', 'errors on the console');
        await page.close();
    },
    async the_3d_view_is_drawn_when_it_is_asked_for() {
        const page = await browser.page();
        await scanning(page);
        expect_equal(await page.value('Boolean(sonoplay.app.scan.view3d.gl)'), false, 'nothing is paid for before');
        await page.key('KeyN');
        await page.key('KeyV');
        const room = 'document.getElementById("view3d-room")';
        // Some browsers draw without a graphics card; where this one does not, it says so.
        await page.until(`!${room}.hidden || document.getElementById("bar-notice").textContent.includes("WebGL2")`);
        if (!await page.value(`${room}.hidden`)) {
            await page.until('sonoplay.app.scan.view3d.meshes?.length > 7');
            const lit = await page.value(`(() => {
                const {view3d} = sonoplay.app.scan, {gl, canvas} = view3d, bytes = new Uint8Array(4 * canvas.width * canvas.height);
                view3d.render(canvas.width, canvas.height);
                gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
                return bytes.filter((value, n) => n % 4 === 0 && value > 60).length / (canvas.width * canvas.height);
            })()`);
            expect(lit > 0.05, `body and tools are in the view: ${lit}`);
            const before = await page.value('sonoplay.app.scan.view3d.orbit.yaw');
            await page.value('document.getElementById("view3d").focus()');
            await page.key('ArrowRight');
            await page.until(`sonoplay.app.scan.view3d.orbit.yaw > ${before}`);
            await page.value('document.getElementById("picture").focus()');
            await page.key('KeyV');
            await page.until(`${room}.hidden`);
        }
        expect_equal(page.errors.filter((one) => !/WebGL/.test(one)).join(), '', 'errors on the console');
        await page.close();
    },
    async freezing_holds_the_picture_and_looks_back() {
        const page = await browser.page();
        await scanning(page);
        await page.until('sonoplay.app.scan.values.kept > 5');
        await page.key('Space');
        await page.until('sonoplay.app.scan.frozen');
        await page.key('Comma');
        await page.key('Comma');
        await page.until('sonoplay.app.scan.back === 2 && document.getElementById("cine-words").textContent.startsWith("FROZEN")');
        await page.key('Space');
        await page.until('!sonoplay.app.scan.frozen');
        await page.close();
    },
    async no_request_goes_to_another_host_and_the_second_visit_needs_none() {
        const page = await browser.page();
        await scanning(page);
        await page.value('navigator.serviceWorker.ready.then(() => true)');
        await page.until('navigator.serviceWorker.controller');
        for (const request of page.requests) expect(request.startsWith(url) || request.startsWith('data:') || request.startsWith('blob:'), request);
        await page.value(`caches.open('sonocase-cases-2').then((cache) => cache.keys()).then((keys) => keys.length > 0)`);
        await page.send('Network.emulateNetworkConditions', {offline: true, latency: 0, downloadThroughput: -1, uploadThroughput: -1});
        server.closeAllConnections?.();
        const offline = new Promise((done) => server.close(done));
        await offline;
        const loaded = page.once('Page.loadEventFired');
        await page.send('Page.reload');
        await loaded;
        await page.until(`${kFrames} > 3`);
        await new Promise((done) => server.listen(Number(new URL(url).port), '127.0.0.1', done));
        await page.close();
    },
    async every_control_has_a_name_and_words_have_contrast() {
        const page = await browser.page();
        const look = () => page.value(`(() => {
            const faults = [];
            const luminance = (colour) => {
                const [r, g, b] = colour.match(/[\\d.]+/g).map(Number).map((c) => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
                return 0.2126 * r + 0.7152 * g + 0.0722 * b;
            };
            const fill = (e) => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor; if (!/rgba\\(.*, 0\\)/.test(c)) return c; } return 'rgb(255,255,255)'; };
            const look = (where) => {
                for (const e of document.querySelectorAll('button, input, select, a, canvas[tabindex], summary')) {
                    if (!e.checkVisibility()) continue;
                    const name = e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.[0]?.textContent.trim();
                    if (!name) faults.push(where + ': no name: ' + e.outerHTML.slice(0, 80));
                    if (e.tabIndex < 0) faults.push(where + ': not by keyboard: ' + name);
                }
                for (const e of document.querySelectorAll('*')) {
                    if (!e.checkVisibility() || ![...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim())) continue;
                    const [a, b] = [luminance(getComputedStyle(e).color), luminance(fill(e))].sort((x, y) => y - x);
                    if ((a + 0.05) / (b + 0.05) < 4.5) faults.push(where + ': contrast ' + ((a + 0.05) / (b + 0.05)).toFixed(2) + ': ' + e.textContent.trim().slice(0, 40));
                }
            };
            look('scan');
            for (const mode of ['colour', 'power', 'spectral', 'm_mode']) { sonoplay.app.scan.doppler.choose(mode); look(mode); }
            sonoplay.app.scan.doppler.choose('off');
            sonoplay.app.scan.view3d.show_it(true);
            look('3-D view');
            for (const name of ['start', 'after', 'scores']) {
                sonoplay.app.show(name);
                for (const disabled of [true, false]) {
                    for (const e of document.querySelectorAll('#' + name + ' button, #' + name + ' select')) e.disabled = disabled;
                    look(name);
                    // A control that cannot be used is not what stands out.
                    for (const e of document.querySelectorAll('button:disabled')) if (e.checkVisibility() && Math.abs(luminance(fill(e)) - luminance(fill(e.parentElement))) > 0.2) faults.push(name + ': disabled: ' + e.textContent);
                }
            }
            document.getElementById('help').showModal(); look('help');
            document.getElementById('help').close();
            sonoplay.app.show('scan');
            return faults;
        })()`);
        await scanning(page);
        for (const scheme of ['dark', 'light']) {
            await page.send('Emulation.setEmulatedMedia', {features: [{name: 'prefers-color-scheme', value: scheme}]});
            expect_equal((await look()).join('\n'), '', `faults, ${scheme}`);
        }
        await page.close();
    },
    async the_picture_takes_the_width_and_height_that_the_page_has() {
        for (const [width, height, ratio] of [[1920, 1080, 1], [1280, 720, 1], [844, 390, 2]]) {
            const page = await browser.page(width, height);
            Object.assign(page, {mobile: ratio > 1, ratio});
            await scanning(page);
            const said = await page.value(`(() => {
                const {picture, values} = sonoplay.app.scan, box = document.getElementById('picture-box').getBoundingClientRect(), of = picture.canvas.getBoundingClientRect();
                const middle = picture.mm_at(of.left + (values.origin_x + 0.5) * of.width / values.width, of.top + (values.origin_y + 0.5) * of.height / values.height, values);
                return {wide: of.width / (box.width - 44), high: of.height / box.height, square: of.width / values.width / (of.height / values.height),
                        px: values.width * values.height, drawn: sonoplay.frame().pixels.length, mm: Math.hypot(middle.x, middle.z)};
            })()`);
            expect(Math.max(said.wide, said.high) > 0.99 && Math.min(said.wide, said.high) > 0.9, `fills its room: ${JSON.stringify(said)}`);
            expect(Math.abs(said.square - 1) < 1e-3 && said.px <= 1024 * 1024 && said.drawn === said.px && said.mm < 1, `square pixels, where they are drawn: ${JSON.stringify(said)}`);
            await page.close();
        }
    },
    async a_phone_held_upright_shows_picture_needle_and_attempt_without_sideways_scrolling() {
        const page = await browser.page(390, 844);
        Object.assign(page, {mobile: true, ratio: 2});
        await scanning(page);
        expect(await page.value('document.documentElement.scrollWidth <= innerWidth'), 'no sideways scrolling');
        expect(await page.value('document.getElementById("picture").getBoundingClientRect().bottom < innerHeight'), 'the picture is whole');
        await page.close();
    },
    async bad_cases_are_refused_in_words() {
        const page = await browser.page();
        await page.open(`${url}?case=nobody`);
        await page.until('document.getElementById("notice").textContent.includes("no case named nobody")');
        for (const [bytes, words] of [[Buffer.from('holiday'), 'mine.sonocase'], [readFileSync(case_file).subarray(0, 5000), 'mine.sonocase']]) {
            await page.value(`sonoplay.app.open_file(new File([new Uint8Array(${JSON.stringify([...bytes])})], 'mine.sonocase'))`);
            await page.until(`document.getElementById("notice").textContent.includes(${JSON.stringify(words)}) && !document.getElementById("start").hidden`);
        }
        await page.close();
    },
    async results_reach_a_learning_record_store_where_one_is_set_up() {
        const statements = [];
        const store = createServer((request, response) => {
            const headers = {'Access-Control-Allow-Origin': request.headers.origin ?? '*', 'Access-Control-Allow-Credentials': 'true',
                'Access-Control-Allow-Headers': 'content-type, x-experience-api-version'};
            let text = '';
            request.on('data', (data) => { text += data; });
            request.on('end', () => {
                if (request.method === 'POST' && request.url === '/xapi/statements') statements.push(...JSON.parse(text));
                response.writeHead(request.method === 'OPTIONS' ? 204 : 200, headers).end('[]');
            });
        });
        await new Promise((done) => store.listen(0, '127.0.0.1', done));
        const with_store = join(work, 'with-store');
        run(join(bin, 'sonocase'), 'publish', case_file, '-o', with_store, '--program', program, '--xapi', `http://127.0.0.1:${store.address().port}/xapi`);
        const [its_server, its_url] = await serve(with_store);
        const page = await browser.page();
        await page.open(`${its_url}?case=small`);
        await page.until(`${kFrames} > 0`);
        await page.key('KeyB');
        await page.until(`${seconds_attempt} > 5.2`);
        await page.key('KeyB');
        await page.until('sonoplay.app.settled === sonoplay.app.started');
        expect_equal(await page.value('document.getElementById("after-notice").textContent.includes("store")'), false, 'the store took it');
        const verbs = () => statements.map((one) => one.verb.display.en).sort().join();
        expect_equal(verbs(), 'attempted,completed,scored', 'statements');
        for (const one of statements) expect(one.actor.account && one.object.id.includes('exercise=scan') && one.timestamp, 'a whole statement');
        await page.close();
        for (const one of [store, its_server]) { one.closeAllConnections?.(); one.close(); }
    },
    async a_procedure_is_asked_done_and_ticked() {
        const procedures = join(work, 'procedures.sonocase'), its_site = join(work, 'procedures');
        const scenario = new URL('../../../scenarios/procedures', import.meta.url).pathname;
        cook_draft(bin, procedures, scenario);
        run(join(bin, 'sonocase'), 'publish', procedures, '-o', its_site, '--program', program);
        const [its_server, its_url] = await serve(its_site);
        const page = await browser.page();
        await page.open(`${its_url}?case=procedures&exercise=liver-biopsy`);
        await page.until(`${kFrames} > 0 && sonoplay.app.scan.complete`);
        const text = (id) => page.value(`document.getElementById("${id}").textContent`);
        expect(await page.value('document.getElementById("procedure").hidden'), 'no procedure before the attempt');
        await page.key('KeyB');
        await page.until('!document.getElementById("question").hidden');
        expect_equal(await page.value('document.querySelectorAll("#steps li").length'), 5, 'steps');
        expect((await text('question-words')).includes('INR'), 'the question');
        const press = (words) => page.value(`[...document.querySelectorAll("#options button")].find((one) => one.textContent === "${words}").click()`);
        await press('Later');
        expect_equal(await text('question-words'), 'A question waits', 'put off');
        await press('Show it');
        expect((await text('question-words')).includes('INR'), 'the question again');
        await page.value('document.querySelectorAll("#options button")[1].click()');
        await page.until('document.getElementById("question").hidden');
        await page.value('document.querySelector("#tray button").click()');
        await page.until('document.getElementById("hands-words").textContent === "1 ml injected"');
        await page.key('KeyJ');
        await page.until('document.getElementById("hands-words").textContent === "2 ml injected"');
        await page.until(`${seconds_attempt} > 5.2`);
        await page.key('KeyB');
        await page.until('sonoplay.app.settled === sonoplay.app.started');
        const lines = await page.value('[...document.querySelectorAll("#checklist tr")].map((line) => line.textContent)');
        expect_equal(lines.length, 9, 'items');
        expect_equal(lines.filter((line) => line.startsWith('Clotting') && line.includes('done')).length, 1, 'the answer counts');
        expect(lines.some((line) => line.startsWith('Core') && line.includes('Not done')), 'what was left out is named');
        expect_equal(await text('verdict'), '✗ Not passed yet', 'verdict');
        expect((await text('advice')).startsWith('Missing: '), 'the first critical item that is missing is named');
        // A moment of the list is shown again.
        await page.value('document.querySelector("#checklist button").click()');
        await page.until('sonoplay.app.scan.replays && document.getElementById("after").hidden');
        await page.click('to-results');
        // The list, its moments and its points are those of the score, which the desktop gives too.
        const {items, points, max_points, cut} = JSON.parse(await page.value('sonoplay.app.attempt.score_text')).procedure;
        expect_equal(await text('checklist-words'), `Checklist: ${items.filter((one) => one.ticked).length} of ${items.length}, ${points} points of ${max_points}, ${cut} needed`, 'points');
        const clock = (s) => s === null ? '–' : `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, '0')}`;
        expect_equal(lines.join('|'), items.map((one) => one.title + clock(one.time_s) + (one.critical ? 'critical' : '') + (one.ticked ? '✓ done'
            : `✗ ${{too_early: 'Too early', too_late: 'Too late', happened: 'It happened', not_tried: 'Not tried', wrong_answer: 'Answered wrongly', not_answered: 'Not answered'}[one.why] ?? 'Not done'}`)).join('|'), 'each line');
        // A scan says nothing of needles until one is taken.
        await page.open(`${its_url}?case=procedures&exercise=planes`);
        await page.until(`${kFrames} > 0 && sonoplay.app.scan.complete`);
        await page.until('document.getElementById("value-punctures").hidden');
        await page.key('KeyN');
        await page.until('!document.getElementById("value-punctures").hidden');
        // The same exercise again keeps the gain that was set; another one opens at 0 with even depth gain.
        const gain = 'sonoplay.app.scan.console.gain_db', exercise = await page.value('sonoplay.app.exercise');
        await page.value('sonoplay.app.scan.set_console({gain_db: 9}); sonoplay.app.scan.set_tgc(2, -5)');
        await page.value(`sonoplay.app.choose_exercise(${exercise})`);
        await page.until(`${kFrames} > ${await page.value(kFrames)} + 2`);
        expect_equal(await page.value(gain), 9, 'the same again');
        await page.value(`sonoplay.app.choose_exercise(${exercise + 1})`);
        await page.until(`sonoplay.app.exercise !== ${exercise} && ${gain} === 0 && sonoplay.app.scan.console.tgc_db[2] === 0`);
        expect_equal(page.errors.join(), '', 'errors on the console');
        await page.close();
        its_server.closeAllConnections?.();
        its_server.close();
    },
    async a_newcomer_is_guided_in_german() {
        const page = await browser.page();
        await page.open(`${url}?lang=de`);
        await page.until('sonoplay.app.ready && document.querySelectorAll("#cases button").length === 1');
        const text = (id) => page.value(`document.getElementById("${id}").textContent`);
        expect_equal(await page.value('document.documentElement.lang'), 'de', 'language');
        expect_equal(await text('start-title'), 'Ultraschallfälle', 'title');
        expect((await page.value('document.querySelector("#cases button").textContent')).includes('Nicht versucht'), 'how one stands');
        await page.until('document.querySelector("#cases img").naturalWidth === 416');  // the ultrasound that publish drew
        await page.click('guided');
        await page.until(`${kFrames} > 0 && document.getElementById("guide-title").textContent === "Schallkopf schieben"`);
        // A hand's way, picture by picture: a jump would be another exercise.
        await page.value('(() => { const {core, scan} = sonoplay.app; for (let n = 1; n < 8; ++n) { core.calls.slide(0, 5); scan.draw(performance.now() / 1000 + 0.04 * n); } })()');
        await page.until('document.getElementById("guide-title").textContent === "Schallkopf kippen"');
        for (const title of ['Bild anhalten', 'Nadel nehmen']) {
            await page.click('skip-guide');
            await page.until(`document.getElementById("guide-title").textContent === "${title}"`);
        }
        await page.key('KeyN');
        await page.until('document.getElementById("guide-step").textContent === "Schritt 5 von 6"');
        // Presets and the mark's side are the window's.
        await page.value('document.querySelectorAll("#presets button")[2].click()');
        expect_equal(await page.value('[sonoplay.app.scan.values.depth_mm, sonoplay.app.scan.values.focus_mm].join()'), '50,20', 'vessel');
        expect(await page.value(`(() => {
            const {scan} = sonoplay.app, canvas = document.getElementById('overlay'), on = canvas.getContext('2d');
            const ring = () => {
                scan.draw(performance.now() / 1000);
                const middle = scan.picture.left + scan.values.origin_x * scan.picture.css_per_px, {data} = on.getImageData(0, 0, canvas.width, canvas.height);
                let left = 0, right = 0;
                const from = middle - scan.picture.css_width / 2, to = middle + scan.picture.css_width / 2;
                for (let n = 3; n < data.length; n += 4) if (data[n]) { const x = (n >> 2) % canvas.width; if (x > from && x < middle) ++left; else if (x < to && x > middle) ++right; }
                return [left, right];
            };
            const plain = ring();
            scan.flip();
            const flipped = ring();
            return plain[1] > plain[0] && flipped[0] > flipped[1];
        })()`), 'the mark is on the side that x points to, also when flipped');
        expect_equal(await page.value('[...sonoplay.words.missing].join(" | ")'), '', 'words without German');
        await page.close();
    },
    async one_page_opens_from_disk() {
        const file = join(work, 'one.html');
        run(join(bin, 'sonocase'), 'publish', case_file, '-o', file, '--single-file', '--program', program);
        const page = await browser.page();
        await page.open(`file://${file}`);
        await page.until('sonoplay.app.ready && document.querySelectorAll("#cases button").length === 1');
        await page.value('document.querySelector("#cases button").click()');
        await page.until(`${kFrames} > 3`);
        expect_equal(page.errors.join(), '', 'errors on the console');
        await page.close();
    },
});
await browser.stop();
server.closeAllConnections?.();
server.close();
