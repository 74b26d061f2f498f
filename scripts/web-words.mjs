// SPDX-License-Identifier: Apache-2.0

// Catalogues of the page's words: those of the window's and the page's own .po files that page or program can say.
import {readFileSync, readdirSync, statSync} from 'node:fs';
import {join} from 'node:path';

const read = (...path) => readFileSync(join(...path), 'utf8');

// {code, name, words: {english: other}} of the text of a .po file (formats/words/catalogue.h).
export function read_po(text) {
    const words = {};
    let key = null, of = null, entry = {};
    const take = () => {
        if (entry.msgid !== undefined && entry.msgstr) words[entry.msgid] = entry.msgstr;
        entry = {};
    };
    for (const line of [...text.split('\n'), 'msgid ""']) {
        const found = /^(?:(msgid|msgstr) )?"(.*)"$/.exec(line);
        if (!found) continue;
        [, key, of] = [null, found[1] ?? key, JSON.parse(`"${found[2]}"`)];
        if (found[1] === 'msgid') take();
        entry[key] = (entry[key] ?? '') + of;
    }
    const header = words[''] ?? '';
    delete words[''];
    return {code: /^Language: (.*)$/m.exec(header)?.[1], name: /^X-Language-Name: (.*)$/m.exec(header)?.[1], words};
}

const one_line = (text) => text.replace(/\s+/g, ' ').trim();
const plain = (html) => html.replaceAll('&amp;', '&').replaceAll('&lt;', '<').replaceAll('&gt;', '>').replaceAll('&quot;', '"');

// What the page asks for: texts and attributes of index.html, and each t('...') of the modules.
export function page_words(page, attributes = ['title', 'aria-label', 'alt', 'placeholder']) {
    const found = new Set();
    // Less what stands there in another language already.
    const html = read(page, 'index.html').replace(/<!--[\s\S]*?-->/g, '').replace(/[\s\S]*<body>/, '').replace(/<(\w+) lang="[^"]*">[\s\S]*?<\/\1>/g, '');
    for (const [, text] of html.matchAll(/>([^<]*[A-Za-z][^<]*)</g)) found.add(plain(one_line(text)));
    for (const [, name, text] of html.matchAll(/ ([a-z-]+)="([^"]*)"/g))
        if (attributes.includes(name) && /[A-Za-z]/.test(text)) found.add(plain(one_line(text)));
    for (const name of readdirSync(page).filter((one) => one.endsWith('.js')))
        for (const [, quoted] of read(page, name).matchAll(/\bt\('((?:[^'\\]|\\.)*)'/g)) found.add(quoted.replaceAll('\\\'', '\''));
    return found;
}

// Texts of the rooms that the program is made of.
function program_words(root) {
    const found = new Set();
    const visit = (folder) => {
        for (const name of readdirSync(folder).sort()) {
            const path = join(folder, name);
            if (statSync(path).isDirectory()) visit(path);
            else if (/\.(cpp|h)$/.test(name))
                for (const [literal] of read(path).matchAll(/"(?:[^"\\\n]|\\.)*"(?:\s*"(?:[^"\\\n]|\\.)*")*/g))
                    found.add(literal.replace(/^"|"$/g, '').replace(/"\s*"/g, '').replace(/\\(.)/g, '$1'));
        }
    };
    for (const room of ['formats', 'runtime/engine', 'runtime/imaging', 'runtime/recording', 'runtime/tracking', 'runtime/web']) visit(join(root, room));
    return found;
}

// One for each language: {code, name, words, missing: what the page asks for and no catalogue has, twice: what both have}.
export function page_catalogues(root) {
    const page = join(root, 'runtime/web/page'), window_po = join(root, 'formats/words/locale');
    const asked = page_words(page), program = program_words(root);
    return readdirSync(window_po).filter((name) => name.endsWith('.po')).sort().map((name) => {
        const {code, name: called, words} = read_po(read(window_po, name)), own = read_po(read(page, 'locale', name)).words;
        const kept = Object.keys(words).filter((english) => asked.has(english) || program.has(english)).sort();
        return {code, name: called, words: {...Object.fromEntries(kept.map((english) => [english, words[english]])), ...own},
            missing: [...asked].filter((english) => !(english in words) && !(english in own)).sort(),
            twice: Object.keys(own).filter((english) => english in words), unused: Object.keys(own).filter((english) => !asked.has(english) && !program.has(english))};
    });
}
