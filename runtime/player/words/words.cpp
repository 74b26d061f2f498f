// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/words/words.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <vector>

#include "runtime/player/words/german.h"

namespace sonocase::runtime {
namespace {

const Language* g_in_use = nullptr;  // ImGui, which shows the words, is one per process too

std::set<std::string> g_missing;

std::vector<Translation> sorted(std::initializer_list<std::span<const Translation>> parts) {
    std::vector<Translation> all;
    for (const auto part : parts) all.insert(all.end(), part.begin(), part.end());
    std::sort(all.begin(), all.end(), [](const Translation& a, const Translation& b) {
        return std::strcmp(a.english, b.english) < 0;
    });
    return all;
}

}  // namespace

const std::set<std::string>& missing_words() {
    return g_missing;
}

std::span<const Language> languages() {
    static const std::vector<Translation> kGerman =
        sorted({german_measures(), german_modes(), german_notices(), german_sentences(),
                german_setup(), german_tissue(), german_window()});
    static const Language kLanguages[] = {{"en", "English", {}}, {"de", "Deutsch", kGerman}};
    return kLanguages;
}

void use_language(const std::string& code) {
    g_in_use = &languages().front();
    for (const Language& language : languages()) {
        if (code.rfind(language.code, 0) == 0 &&
            (code.size() == 2 || !std::isalpha(static_cast<unsigned char>(code[2]))))
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
    const auto catalogue = language_in_use().catalogue;
    const auto found = std::lower_bound(
        catalogue.begin(), catalogue.end(), english,
        [](const Translation& t, const char* key) { return std::strcmp(t.english, key) < 0; });
    if (found != catalogue.end() && std::strcmp(found->english, english) == 0) return found->other;
    return nullptr;
}

const char* tr(const char* english) {
    if (const char* other = translation(english)) return other;
    if (!language_in_use().catalogue.empty() && *english) g_missing.insert(english);
    return english;
}

}  // namespace sonocase::runtime
