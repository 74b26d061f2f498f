// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_words {
namespace {

const Language* g_in_use = nullptr;  // ImGui, which shows the words, is one per process too

std::set<std::string> g_missing;

}  // namespace

const std::set<std::string>& missing_words() {
    return g_missing;
}

void use_language(const std::string& code) {
    g_in_use = &find_language(code);
}

const Language& language_in_use() {
    return g_in_use ? *g_in_use : languages().front();
}

const char* translation(const char* english) {
    const std::string* other = language_in_use().find(english);
    return other ? other->c_str() : nullptr;
}

const char* tr(const char* english) {
    if (const char* other = translation(english)) return other;
    if (!language_in_use().catalogue.empty() && *english) g_missing.insert(english);
    return english;
}

std::string tr_message(const Message& message) {
    return language_in_use().words(message);
}

std::string tissue_words(const std::string& label) {
    return language_in_use().tissue_words(label);
}

}  // namespace sonocase::runtime::inline player_words
