// SPDX-License-Identifier: Apache-2.0

// What the page says, by gettext's method: the English words stand in the code and are the key of the catalogues,
// those of the window (formats/words/locale) and the page's own (locale). scripts/web-words.mjs makes one file a language
// of them, words-CODE.json.
const kLanguages = [['en', 'English'] /*LANGUAGES*/];
let language = 'en', catalogue = {};

export const languages = () => kLanguages;
export const language_in_use = () => language;
// What was asked for and is not in the catalogue; for tests.
export const missing_words = new Set();

// The words in the language in use, with the values in the places of their fields, printf's or "{}".
export function t(english, ...values) {
    const found = catalogue[english];
    if (found === undefined && language !== 'en' && english) missing_words.add(english);
    let n = 0;
    return (found ?? english).replace(/%%|%\+?(?:\.(\d))?(?:zu|[dsf])|\{\}/g, (field, digits) => {
        if (field === '%%') return '%';
        const value = values[n++];
        return digits === undefined ? String(value) : Number(value).toFixed(digits);
    });
}

// The language that the address asks for (?lang=), that was chosen here, or that the browser prefers.
function wanted_language() {
    let chosen = null;
    try {
        chosen = localStorage.getItem('sonocase-language');
    } catch {
        // No storage: the browser's.
    }
    for (const one of [new URLSearchParams(location.search).get('lang'), chosen, ...navigator.languages ?? []]) {
        const known = kLanguages.find(([code]) => one && (one === code || one.startsWith(`${code}-`)));
        if (known) return known[0];
    }
    return 'en';
}
export function choose_language(code) {
    try {
        localStorage.setItem('sonocase-language', code);
    } catch {
        // For this visit, then.
    }
    const address = new URL(location.href);
    address.searchParams.set('lang', code);
    location.replace(address);
}

// Before anything is shown. Without its file the page stays English.
export async function begin_words() {
    const wanted = wanted_language();
    if (wanted === 'en') return;
    try {
        const inside = document.getElementById(`words-${wanted}`);
        catalogue = inside ? JSON.parse(inside.textContent) : await (await fetch(`words-${wanted}.json`)).json();
        language = wanted;
    } catch (error) {
        console.warn(`No words for ${wanted}: ${error.message}`);
        return;
    }
    document.documentElement.lang = language;
    translate_page(document.body);
}

// The words and attributes of elements as index.html has them.
export const kWordAttributes = ['title', 'aria-label', 'alt', 'placeholder'];
function translate_page(root) {
    const one_line = (text) => text.replace(/\s+/g, ' ').trim();
    const texts = document.createTreeWalker(root, NodeFilter.SHOW_TEXT), all = [];
    while (texts.nextNode()) if (!/^(SCRIPT|STYLE)$/.test(texts.currentNode.parentElement.tagName)) all.push(texts.currentNode);
    for (const node of all) {
        const english = one_line(node.data);
        if (/[A-Za-z]/.test(english)) node.data = node.data.replace(/\S[\s\S]*\S|\S/, () => t(english));
    }
    for (const name of kWordAttributes)
        for (const element of root.querySelectorAll(`[${name}]`))
            if (/[A-Za-z]/.test(element.getAttribute(name))) element.setAttribute(name, t(one_line(element.getAttribute(name))));
}

// A label as clinicians write it; label: of the description's labels (page_json.h).
export function label_words({english, words, side, number}) {
    if (language === 'en') return english;
    return [t(words), side && t(side), number].filter((part) => part).join(' ');
}

// The texts of an exercise in the language in use (page_json.h): an exercise like it.
export function exercise_texts(exercise) {
    return {...exercise, ...exercise.texts?.[language]};
}
