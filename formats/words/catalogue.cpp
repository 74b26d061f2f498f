// SPDX-License-Identifier: Apache-2.0

#include "formats/words/catalogue.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <utility>

#include "formats/base/clinical_names.h"

namespace sonocase {
namespace {

bool takes(std::string_view& line, std::string_view keyword) {
    if (line.substr(0, keyword.size()) != keyword) return false;
    line.remove_prefix(keyword.size());
    return true;
}

// What stands between the quotes of a line, without its backslashes.
std::string unquoted(std::string_view line) {
    std::string out;
    const std::size_t begin = line.find('"') + 1, end = line.rfind('"');
    for (std::size_t i = begin; i < end; ++i) {
        if (line[i] != '\\') {
            out += line[i];
            continue;
        }
        const char c = line[++i];
        out += c == 'n' ? '\n' : c == 't' ? '\t' : c;
    }
    return out;
}

// The value of a line "Key: value" of the header.
std::string header_value(const std::string& header, const std::string& key) {
    const std::size_t at = header.find(key + ": ");
    if (at == std::string::npos) return "";
    const std::size_t begin = at + key.size() + 2;
    return header.substr(begin, header.find('\n', begin) - begin);
}

}  // namespace

Language read_po(std::string_view text) {
    Language language;
    Translation entry;
    std::string* part = nullptr;  // of the entry, to which the line in hand belongs
    bool fuzzy = false, next_fuzzy = false;
    const auto finish = [&] {
        if (part == &entry.other && entry.english.empty()) {
            language.code = header_value(entry.other, "Language");
            language.name = header_value(entry.other, "X-Language-Name");
        } else if (part == &entry.other && !entry.other.empty() && !fuzzy) {
            language.catalogue.push_back(entry);
        }
        entry = {};
        fuzzy = std::exchange(next_fuzzy, false);
    };
    while (!text.empty()) {
        std::string_view line = text.substr(0, text.find('\n'));
        text.remove_prefix(std::min(line.size() + 1, text.size()));
        if (takes(line, "#,")) {
            next_fuzzy = next_fuzzy || line.find("fuzzy") != std::string_view::npos;
        } else if (takes(line, "msgid ")) {
            finish();
            part = &entry.english;
        } else if (takes(line, "msgstr ")) {
            part = &entry.other;
        }
        if (part && !line.empty() && line.find_first_not_of(' ') == line.find('"'))
            *part += unquoted(line);
    }
    finish();
    std::sort(language.catalogue.begin(), language.catalogue.end(),
              [](const Translation& a, const Translation& b) { return a.english < b.english; });
    return language;
}

const std::string* Language::find(std::string_view english) const {
    const auto found = std::lower_bound(
        catalogue.begin(), catalogue.end(), english,
        [](const Translation& t, std::string_view key) { return t.english < key; });
    return found != catalogue.end() && found->english == english ? &found->other : nullptr;
}

std::string Language::words(std::string_view english) const {
    const std::string* other = find(english);
    return other ? *other : std::string(english);
}

std::string Language::words(const Message& message) const {
    if (catalogue.empty()) return static_cast<const std::string&>(message);
    if (message.arguments().empty()) return words(message.format());
    std::vector<std::string> arguments;
    for (const Message& argument : message.arguments()) arguments.push_back(words(argument));
    return filled_in(words(message.format()), arguments);
}

std::string Language::tissue_words(const std::string& label) const {
    const LabelParts parts = label_parts(label);
    const std::string* known = find(parts.words);
    if (!known) return clinical_name(label);
    std::string out = *known;
    if (!parts.side.empty()) out += " " + words(std::string_view(parts.side));
    if (!parts.number.empty()) out += " " + parts.number;
    return out;
}

std::span<const Language> languages() {
    static const std::vector<Language> kLanguages = [] {
        std::vector<Language> all{{"en", "English", {}}};
        for (const std::string_view text : detail::catalogue_texts()) all.push_back(read_po(text));
        return all;
    }();
    return kLanguages;
}

const Language& find_language(std::string_view code) {
    for (const Language& language : languages()) {
        const std::size_t end = language.code.size();
        if (code.substr(0, end) == language.code &&
            (code.size() == end || !std::isalpha(static_cast<unsigned char>(code[end]))))
            return language;
    }
    return languages().front();
}

std::string locale_language() {
    for (const char* name : {"LC_ALL", "LC_MESSAGES", "LANG"}) {
        const char* value = std::getenv(name);
        if (value && *value) return value;
    }
    return "en";
}

}  // namespace sonocase
