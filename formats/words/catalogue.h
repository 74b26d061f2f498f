// SPDX-License-Identifier: Apache-2.0

// What people read, in their language, by gettext's method: the English words stand in the code and
// are the keys of the catalogues, formats/words/locale/<language>.po, which are compiled into the
// programs that show them: neither libintl nor files beside them are needed.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/message.h"

namespace sonocase {

struct Translation {
    std::string english, other;
};

struct Language {
    std::string code;                    // ISO 639-1
    std::string name;                    // in that language
    std::vector<Translation> catalogue;  // empty: English itself; sorted by `english`

    // Null: the catalogue lacks the words.
    const std::string* find(std::string_view english) const;
    // Words that the catalogue lacks, as they are.
    std::string words(std::string_view english) const;
    // The format and each argument by themselves; what the catalogue lacks stays as it is.
    std::string words(const Message& message) const;
    // The name of a label or target as clinicians write it: "kidney_left" is "Left kidney", "Niere
    // links" (formats/base/clinical_names.h). A name that the catalogue lacks stays English.
    std::string tissue_words(const std::string& label) const;
};

std::span<const Language> languages();  // English first
// code: of a language above, or a locale such as "de_AT.UTF-8"; anything else is English.
const Language& find_language(std::string_view code);
// The code of the user's locale: LC_ALL, LC_MESSAGES or LANG.
std::string locale_language();

// The text of a .po file that `msgfmt --check` accepts. The header gives the language's code
// ("Language") and its own name ("X-Language-Name"). Entries that are fuzzy, obsolete or not yet
// translated are left out, as in gettext; contexts and plural forms are not used.
Language read_po(std::string_view text);

namespace detail {
// The files of formats/words/locale, by name.
std::span<const std::string_view> catalogue_texts();
}  // namespace detail

}  // namespace sonocase
