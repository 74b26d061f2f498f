// SPDX-License-Identifier: Apache-2.0

// Every word of the page is in every catalogue, once, with its fields; and is filled in as printf would.
import {page_catalogues, read_po} from '../../../scripts/web-words.mjs';
import {expect, expect_equal, run_tests} from './support.mjs';

const root = new URL('../../..', import.meta.url).pathname;
const fields = (words) => (words.match(/%%|%\+?(?:\.\d)?(?:zu|[dsf])|\{\}/g) ?? []).join(' ');

await run_tests({
    every_word_of_the_page_is_in_every_catalogue_once() {
        const catalogues = page_catalogues(root);
        expect(catalogues.length > 0, 'there is a language');
        for (const {code, name, words, missing, twice, unused} of catalogues) {
            expect(name, `${code} has a name`);
            expect_equal(missing.join(' | '), '', `${code}: missing`);
            expect_equal(twice.join(' | '), '', `${code}: in the window's catalogue too`);
            expect_equal(unused.join(' | '), '', `${code}: never said`);
            for (const [english, other] of Object.entries(words)) expect_equal(fields(other), fields(english), `${code}: ${english}`);
            for (const one of ['Kidney', 'Slide the probe', 'Find the target first: slide and tilt the probe until it lies in the middle of the picture.'])
                expect(words[one], `${code} has what the program says: ${one}`);
        }
    },
    catalogues_are_read_as_gettext_reads_them() {
        const {code, name, words} = read_po('msgid ""\nmsgstr ""\n"Language: xx\\n"\n"X-Language-Name: Xish\\n"\n\nmsgid ""\n"two "\n"lines"\nmsgstr "zwei \\"Zeilen\\""\nmsgid "empty"\nmsgstr ""\n');
        expect_equal(JSON.stringify({code, name, words}), '{"code":"xx","name":"Xish","words":{"two lines":"zwei \\"Zeilen\\""}}', 'catalogue');
    },
    async fields_are_filled_in_their_order() {
        const {t} = await import('../../../runtime/web/page/words.js');
        expect_equal(t('%s · %.1f MB · exercises: %zu', 'liver', 2.345, 3), 'liver · 2.3 MB · exercises: 3', 'printf');
        expect_equal(t('Left, % across'), 'Left, % across', 'no field');
        expect_equal(t('{} is here: %d %%', 'this', 40), 'this is here: 40 %', 'both');
    },
});
