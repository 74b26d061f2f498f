// SPDX-License-Identifier: Apache-2.0

// web-pack.mjs PAGE WASM OUT: what `sonocase publish` copies. The page's modules become one script, so that a visit
// asks for few files; those of a course become another, and those of the page's trackers more of them. single.html holds page, style, script and program in one file;
// its places <!--LIST--> and <!--CASES--> are publish's to fill.
import {createHash} from 'node:crypto';
import {existsSync, mkdirSync, readFileSync, writeFileSync} from 'node:fs';
import {page_catalogues} from './web-words.mjs';

const [page, wasm, out] = process.argv.slice(2);
const read = (name) => readFileSync(`${page}/${name}`, 'utf8');
const hash = (data) => createHash('sha256').update(data).digest('base64');

// Modules in the order in which they need each other. Each imports by one line per module and exports declarations
// only, and top-level names are unique: then the text without those words is the same program.
const modules = ['words.js', 'core.js', 'source.js', 'arriving.js', 'results.js', 'picture.js', 'poses.js', 'scan_keys.js', 'hands.js', 'doppler.js', 'view3d.js', 'scan.js', 'placed_tracker.js', 'app.js'];
const of_course = ['lms.js', 'course.js'];  // fetched where a site has a course
const of_camera = ['camera.js'], has_camera = existsSync(`${wasm}/camera.wasm`);  // fetched when it is chosen, with worker and program
const of_usb = ['usb.js'];  // so is that of trackers on USB, with its program
const seen = new Map(), asked = new Set();
// The text, and what it needs of the script, which is to export it.
function packed(names) {
    let text = '';
    const needs = new Set();
    for (const name of names) {
        const lines = read(name).split('\n').filter((line) => {
            const found = /^import \{(.*)\} from '\.\/([a-z0-9_]+\.js)';$/.exec(line);
            if (found && !names.includes(found[2])) for (const one of found[1].split(', ')) asked.add(one) && needs.add(one);
            return !found;
        });
        for (const line of lines) {
            if (/^import\b/.test(line)) throw new Error(`${name}: an import on more than one line: ${line}`);
            const top = /^(?:export )?(?:async )?(?:function|class|const|let) ([A-Za-z_$]+)/.exec(line);
            if (!top || top[1] === '$') continue;
            if (seen.has(top[1])) throw new Error(`${name}: ${top[1]} is declared in ${seen.get(top[1])} too`);
            seen.set(top[1], name);
        }
        text += lines.map((line) => line.replace(/^export /, '')).filter((line) => !/^\/\/ SPDX/.test(line)).join('\n');
    }
    // Each module has its own $, the same everywhere.
    let first = true;
    text = text.split('\n').filter((line) => {
        if (!/^const \$ = /.test(line)) return true;
        const keep = first;
        first = false;
        return keep;
    }).join('\n');
    return {text, needs: [...needs].sort().join(', ')};
}
// One file of words for each language but English, fetched by those who read it.
const catalogues = page_catalogues(new URL('..', import.meta.url).pathname).map(({code, name, words, missing}) => {
    if (missing.length) throw new Error(`${page}/locale/${code}.po lacks: ${missing.join(' | ')}`);
    return {code, name, file: `words-${code}.json`, text: JSON.stringify(words)};
});
const licence = '// SPDX-License-Identifier: Apache-2.0\n';
function put(text, place, by) {
    if (!text.includes(place)) throw new Error(`the page no longer has ${place}`);
    return text.replace(place, () => by);
}
const languages = catalogues.map(({code, name}) => `, ${JSON.stringify([code, name])}`).join('');
const main = put(put(packed(modules).text, ' /*LANGUAGES*/', languages), 'const kCamera = true;', `const kCamera = ${has_camera};`);
const part = ({text, needs}, name) => `${licence}import {${needs}} from './sonoplay.js';\n${text}export {${name}};\n`;
const course = part(packed(of_course), 'CourseView');
const camera = has_camera ? {'camera.js': part(packed(of_camera), 'CameraTracker'), 'camera_worker.js': read('camera_worker.js'),
    'camera.wasm': readFileSync(`${wasm}/camera.wasm`)} : {};
const usb = {'usb.js': part(packed(of_usb), 'UsbTracker'), 'usb.wasm': readFileSync(`${wasm}/usb.wasm`)};
const trackers = {...camera, ...usb};
const script = `${licence}${main}export {${[...asked].sort().join(', ')}};\n`;

mkdirSync(out, {recursive: true});
for (const {file, text} of catalogues) writeFileSync(`${out}/${file}`, text);
const style = read('style.css'), index = read('index.html'), binary = readFileSync(`${wasm}/sonoplay.wasm`);
const scalar = readFileSync(`${wasm}/sonoplay-scalar.wasm`);
const version = Object.values(trackers).reduce((all, one) => all.update(one), createHash('sha256')).update(script).update(course).update(style).update(index).update(binary).update(scalar).update(catalogues.map(({text}) => text).join()).digest('hex').slice(0, 16);
writeFileSync(`${out}/index.html`, index);
writeFileSync(`${out}/style.css`, style);
writeFileSync(`${out}/sonoplay.js`, script);
writeFileSync(`${out}/course.js`, course);
for (const [name, data] of Object.entries(trackers)) writeFileSync(`${out}/${name}`, data);
writeFileSync(`${out}/worker.js`, read('worker.js').replace('@VERSION@', version).replace('@WORDS@', catalogues.map(({file}) => file).join("', '")));
writeFileSync(`${out}/sonoplay.wasm`, binary);
writeFileSync(`${out}/sonoplay-scalar.wasm`, scalar);

const policy = `default-src 'none'; script-src 'sha256-${hash(script)}' 'wasm-unsafe-eval'; style-src 'sha256-${hash(style)}'; `
    + `img-src blob: data:; connect-src 'none'; base-uri 'none'; form-action 'none'`;
const single = index
    .replace(/content="default-src[^"]*"/, () => `content="${policy}"`)
    .replaceAll(/<link rel="preload".*\n/g, '')
    .replace('<link rel="stylesheet" href="style.css">', () => `<style>${style}</style>`)
    .replace('<script type="module" src="sonoplay.js"></script>', '')
    .replace('</body>', () => catalogues.map(({code, text}) => `<script type="application/json" id="words-${code}">${text.replaceAll('<', '\\u003c')}</script>\n`).join('')
        + `<!--LIST-->\n<!--CASES-->\n<script type="text/plain" id="program">${binary.toString('base64')}</script>\n`
        + `<script type="module">${script}</script>\n</body>`);
if (!single.includes(policy) || !single.includes('<style>')) throw new Error('index.html no longer has what single.html replaces');
writeFileSync(`${out}/single.html`, single);
