// SPDX-License-Identifier: Apache-2.0

// A reader of gettext's catalogues, so that the program needs neither libintl nor files beside it.
#pragma once

#include <span>
#include <string_view>

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_words {

// The text of a .po file that `msgfmt --check` accepts. The header gives the language's code
// ("Language") and its own name ("X-Language-Name"). Entries that are fuzzy, obsolete or not yet
// translated are left out, as in gettext; contexts and plural forms are not used.
Language read_po(std::string_view text);

// The files of runtime/player/locale, by name.
std::span<const std::string_view> catalogue_texts();

}  // namespace sonocase::runtime::inline player_words
