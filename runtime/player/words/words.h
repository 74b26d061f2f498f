// SPDX-License-Identifier: Apache-2.0

// What the window says, in the user's language. The English words stand in the code and are the key
// of the catalogue; a test finds every tr("...") and sees that each other language has it, with the
// same printf fields.
#pragma once

#include <set>
#include <span>
#include <string>

namespace sonocase::runtime {

struct Translation {
    const char *english, *other;
};

struct Language {
    const char* code;                        // ISO 639-1
    const char* name;                        // in that language
    std::span<const Translation> catalogue;  // empty: English itself; sorted by `english`
};

std::span<const Language> languages();  // English first

// code: of a language above, or a locale such as "de_AT.UTF-8"; anything else is English. One per
// process, like the window; to be called by the window's thread.
void use_language(const std::string& code);
const Language& language_in_use();
// The code of the user's locale: LC_ALL, LC_MESSAGES or LANG.
std::string locale_language();

// Words that were asked for and that the catalogue of the language in use lacks; for tests.
const std::set<std::string>& missing_words();

// The words in the language in use; null: its catalogue lacks them.
const char* translation(const char* english);
// The words in the language in use; those that the catalogue lacks as they are.
const char* tr(const char* english);

}  // namespace sonocase::runtime
