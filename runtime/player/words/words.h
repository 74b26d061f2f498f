// SPDX-License-Identifier: Apache-2.0

// What the window says, in the user's language (formats/words/catalogue.h). A test finds every
// tr("...") and Message("...") and sees that each language has it, with the same fields.
#pragma once

#include <algorithm>
#include <cstdio>
#include <set>
#include <string>

#include "formats/base/message.h"
#include "formats/words/catalogue.h"

namespace sonocase::runtime::inline player_words {

// code: as find_language() takes it. One per process, like the window; to be called by the window's
// thread.
void use_language(const std::string& code);
const Language& language_in_use();

// Words that were asked for and that the catalogue of the language in use lacks; for tests.
const std::set<std::string>& missing_words();

// The words in the language in use; null: its catalogue lacks them.
const char* translation(const char* english);
// The words in the language in use; those that the catalogue lacks as they are.
const char* tr(const char* english);

// A format of printf and its values, whatever their length: a language may need more letters than
// English.
template <class... Values>
std::string filled(const char* format, const Values&... values) {
    const int length = std::snprintf(nullptr, 0, format, values...);
    std::string out(static_cast<std::size_t>(std::max(length, 0)), ' ');
    std::snprintf(out.data(), out.size() + 1, format, values...);
    return out;
}

// What is put together before it reaches the window (notices, errors, messages of trackers), in the
// language in use. Standard error keeps the English.
std::string tr_message(const Message& message);

// The name of a label or target in the language in use (formats/words/catalogue.h).
std::string tissue_words(const std::string& label);

}  // namespace sonocase::runtime::inline player_words
