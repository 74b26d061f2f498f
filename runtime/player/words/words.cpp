// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/words/words.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "formats/base/clinical_names.h"
#include "runtime/player/words/po_text.h"

namespace sonocase::runtime::inline player_words {
namespace {

const Language* g_in_use = nullptr;  // ImGui, which shows the words, is one per process too

std::set<std::string> g_missing;

const std::string* find_translation(std::string_view english) {
    const std::vector<Translation>& catalogue = language_in_use().catalogue;
    const auto found = std::lower_bound(
        catalogue.begin(), catalogue.end(), english,
        [](const Translation& t, std::string_view key) { return t.english < key; });
    return found != catalogue.end() && found->english == english ? &found->other : nullptr;
}

}  // namespace

const std::set<std::string>& missing_words() {
    return g_missing;
}

std::span<const Language> languages() {
    static const std::vector<Language> kLanguages = [] {
        std::vector<Language> all{{"en", "English", {}}};
        for (const std::string_view text : catalogue_texts()) all.push_back(read_po(text));
        return all;
    }();
    return kLanguages;
}

void use_language(const std::string& code) {
    g_in_use = &languages().front();
    for (const Language& language : languages()) {
        const std::size_t end = language.code.size();
        if (code.rfind(language.code, 0) == 0 &&
            (code.size() == end || !std::isalpha(static_cast<unsigned char>(code[end]))))
            g_in_use = &language;
    }
}

const Language& language_in_use() {
    return g_in_use ? *g_in_use : languages().front();
}

std::string locale_language() {
    for (const char* name : {"LC_ALL", "LC_MESSAGES", "LANG"}) {
        const char* value = std::getenv(name);
        if (value && *value) return value;
    }
    return "en";
}

const char* translation(const char* english) {
    const std::string* other = find_translation(english);
    return other ? other->c_str() : nullptr;
}

const char* tr(const char* english) {
    if (const char* other = translation(english)) return other;
    if (!language_in_use().catalogue.empty() && *english) g_missing.insert(english);
    return english;
}

std::string tr_message(const Message& message) {
    if (language_in_use().catalogue.empty()) return static_cast<const std::string&>(message);
    const std::string* other = find_translation(message.format());
    if (message.arguments().empty()) return other ? *other : message;
    std::vector<std::string> arguments;
    for (const Message& argument : message.arguments()) arguments.push_back(tr_message(argument));
    return filled_in(other ? *other : message.format(), arguments);
}

std::string tissue_words(const std::string& label) {
    if (language_in_use().catalogue.empty()) return clinical_name(label);
    const LabelParts parts = label_parts(label);
    const char* known = translation(parts.words.c_str());
    if (!known) return clinical_name(label);
    std::string words = known;
    if (!parts.side.empty()) words += std::string(" ") + tr(parts.side.c_str());
    if (!parts.number.empty()) words += " " + parts.number;
    return words;
}

}  // namespace sonocase::runtime::inline player_words
