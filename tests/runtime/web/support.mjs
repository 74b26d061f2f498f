// SPDX-License-Identifier: Apache-2.0

// What the tests of the page share: checks, the oracle, a browser over its DevTools protocol.
import {execFileSync, spawn} from 'node:child_process';
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

export function expect(good, words) {
    if (!good) throw new Error(words);
}
export function expect_equal(is, wanted, words) {
    expect(is === wanted, `${words}: ${JSON.stringify(is)} instead of ${JSON.stringify(wanted)}`);
}

// Runs named tests one after another; the process fails if one does.
export async function run_tests(tests) {
    let failed = 0;
    const only = process.env.WEB_TEST;
    for (const [name, test] of Object.entries(tests)) {
        if (only && name !== only) continue;
        const start = performance.now();
        try {
            await test();
            console.log(`[ OK ] ${name} (${Math.round(performance.now() - start)} ms)`);
        } catch (error) {
            ++failed;
            console.log(`[ FAILED ] ${name}: ${error.stack}`);
        }
    }
    process.exitCode = failed ? 1 : 0;
}

export function folder() {
    const path = mkdtempSync(join(tmpdir(), 'sonocase-web-'));
    process.on('exit', () => rmSync(path, {recursive: true, force: true}));
    return path;
}
export const run = (program, ...args) => execFileSync(program, args, {encoding: 'utf8', maxBuffer: 1 << 28});

// Cooks a scenario as a draft; none: the demonstration torso. The tests' scenarios have most stages in common, which are
// kept beside the programs.
export function cook_draft(bin, to, ...scenario) {
    run(join(bin, 'sonocase'), 'build', ...scenario, '--preset', 'draft', '--quiet', '--cache', join(bin, '../web-cases'), '--cache-limit-mb', '300', '-o', to);
}

// Chromium without a window. Messages go through a pipe, each ended by a zero byte.
export class Browser {
    static async start(...switches) {
        const browser = new Browser();
        browser.profile = mkdtempSync(join(tmpdir(), 'sonocase-chromium-'));
        browser.process = spawn('chromium', ['--headless=new', '--no-sandbox', '--disable-gpu', '--no-first-run',
            '--disable-background-networking', '--disable-component-update', '--remote-debugging-pipe', '--mute-audio',
            `--user-data-dir=${browser.profile}`, ...switches, 'about:blank'], {stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe']});
        browser.ended = new Promise((done) => browser.process.once('exit', done));
        browser.next = 1;
        browser.waiting = new Map();
        browser.listeners = new Set();
        let rest = Buffer.alloc(0);
        browser.process.stdio[4].on('data', (data) => {
            rest = Buffer.concat([rest, data]);
            for (let end; (end = rest.indexOf(0)) >= 0; rest = rest.subarray(end + 1)) browser.take(JSON.parse(rest.subarray(0, end)));
        });
        return browser;
    }
    take(message) {
        if (message.id) {
            const {done, failed} = this.waiting.get(message.id);
            this.waiting.delete(message.id);
            if (message.error) failed(new Error(message.error.message));
            else done(message.result);
        } else {
            for (const listener of [...this.listeners]) listener(message);
        }
    }
    send(method, params = {}, sessionId = undefined) {
        const id = this.next++;
        this.process.stdio[3].write(JSON.stringify({id, method, params, sessionId}) + '\0');
        return new Promise((done, failed) => this.waiting.set(id, {done, failed}));
    }
    // context: of another page, whose storage this one shares.
    async page(width = 1280, height = 720, context = undefined) {
        const browserContextId = context ?? (await this.send('Target.createBrowserContext')).browserContextId;
        const {targetId} = await this.send('Target.createTarget', {url: 'about:blank', browserContextId, ...(context ? {} : {width, height})});
        const {sessionId} = await this.send('Target.attachToTarget', {targetId, flatten: true});
        return Object.assign(new Page(this, sessionId, targetId, width, height), {context: browserContextId});
    }
    async stop() {
        await this.send('Browser.close').catch(() => {});
        await this.ended;
        rmSync(this.profile, {recursive: true, force: true, maxRetries: 5});
    }
}

export class Page {
    constructor(browser, session, target, width, height) {
        Object.assign(this, {browser, session, target, width, height, requests: [], errors: [], dialogs: []});
        browser.listeners.add((message) => {
            if (message.sessionId !== session) return;
            if (message.method === 'Network.requestWillBeSent') this.requests.push(message.params.request.url);
            if (message.method === 'Page.javascriptDialogOpening') {  // "Leave the page?"
                this.dialogs.push(message.params.type);
                this.send('Page.handleJavaScriptDialog', {accept: true}).catch(() => {});
            }
            if (message.method === 'Runtime.exceptionThrown') this.errors.push(message.params.exceptionDetails.exception?.description);
            if (message.method === 'Log.entryAdded' && message.params.entry.level === 'error') this.errors.push(message.params.entry.text);
        });
    }
    send(method, params) { return this.browser.send(method, params, this.session); }
    once(method) {
        return new Promise((done) => {
            const listener = (message) => {
                if (message.sessionId !== this.session || message.method !== method) return;
                this.browser.listeners.delete(listener);
                done(message.params);
            };
            this.browser.listeners.add(listener);
        });
    }
    async open(url) {
        for (const domain of ['Page', 'Network', 'Runtime', 'Log']) await this.send(`${domain}.enable`);
        await this.send('Emulation.setDeviceMetricsOverride', {width: this.width, height: this.height, deviceScaleFactor: this.ratio ?? 1, mobile: Boolean(this.mobile)});
        const loaded = this.once('Page.loadEventFired');
        await this.send('Page.navigate', {url});
        await loaded;
    }
    // The value of an expression in the page; promises are awaited.
    async value(expression) {
        const {result, exceptionDetails} = await this.send('Runtime.evaluate', {expression, awaitPromise: true, returnByValue: true, userGesture: true});
        if (exceptionDetails) throw new Error(`${expression}: ${exceptionDetails.exception?.description ?? exceptionDetails.text}`);
        return result.value;
    }
    // Waits, picture by picture, until the expression is true.
    async until(expression, seconds = 60) {
        const good = await this.value(`new Promise((done) => {
            const end = performance.now() + ${1000 * seconds};
            const look = () => {
                let good = false;
                try { good = Boolean(${expression}); } catch {}
                if (good || performance.now() > end) done(good); else requestAnimationFrame(look);
            };
            look();
        })`);
        if (!good) throw new Error(`never true: ${expression}; notice: ${await this.value('document.getElementById("notice")?.textContent')}; ${this.errors.join('; ')}`);
    }
    click(id) { return this.value(`document.getElementById(${JSON.stringify(id)}).click()`); }
    async key(code, modifiers = 0, type = 'press') {
        const key = {Space: ' ', Enter: 'Enter', Tab: 'Tab', Escape: 'Escape'}[code] ?? code.replace(/^Key|^Digit/, '').toLowerCase();
        const number = {Tab: 9, Enter: 13, Escape: 27, Space: 32}[code] ?? 0;
        const event = {code, key, modifiers, windowsVirtualKeyCode: number, text: code === 'Enter' ? '\r' : undefined};
        if (type !== 'up') await this.send('Input.dispatchKeyEvent', {type: event.text ? 'keyDown' : 'rawKeyDown', ...event});
        if (type !== 'down') await this.send('Input.dispatchKeyEvent', {type: 'keyUp', ...event});
    }
    async picture(path) {
        const {data} = await this.send('Page.captureScreenshot', {format: 'png'});
        const {writeFileSync} = await import('node:fs');
        writeFileSync(path, Buffer.from(data, 'base64'));
    }
    close() { return this.browser.send('Target.closeTarget', {targetId: this.target}); }
}
