// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/words/said.h"

#include <array>
#include <cctype>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

constexpr int kMostDepth = 4;  // of parts within parts

std::string said(std::string_view english, int depth);

// What stands for each %s of the pattern, if the text is of its form; each as short as it can be.
std::optional<std::vector<std::string_view>> match(std::string_view pattern,
                                                   std::string_view text) {
    std::vector<std::string_view> found;
    bool open = false;  // the text before `at` belongs to a field
    for (;;) {
        const std::size_t field = pattern.find("%s");
        const std::string_view fixed = pattern.substr(0, field);
        const std::size_t at =
            field == std::string_view::npos && open
                ? (text.size() < fixed.size() ? std::string_view::npos : text.size() - fixed.size())
                : text.find(fixed);
        if (at == std::string_view::npos || text.substr(at, fixed.size()) != fixed) return {};
        if (open) {
            if (at == 0) return {};
            found.push_back(text.substr(0, at));
        } else if (at != 0) {
            return {};
        }
        text.remove_prefix(at + fixed.size());
        if (field == std::string_view::npos) {
            if (!text.empty()) return {};
            return found;
        }
        pattern.remove_prefix(field + 2);
        open = true;
    }
}

std::string filled(std::string_view pattern,
                   const std::vector<std::string_view>& fields,
                   int depth) {
    std::string out;
    std::size_t next = 0;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
        if (pattern.compare(i, 2, "%s") == 0 && next < fields.size()) {
            out += said(fields[next++], depth + 1);
            ++i;
        } else {
            out += pattern[i];
        }
    }
    return out;
}

// The two parts of an Error's message, each on its own.
std::optional<std::string> in_parts(std::string_view english, int depth) {
    for (const std::string_view between : {"; ", ": "}) {
        const std::size_t at = english.find(between);
        if (at == std::string_view::npos || at == 0) continue;
        return said(english.substr(0, at), depth + 1) + std::string(between) +
               said(english.substr(at + between.size()), depth + 1);
    }
    return {};
}

std::string said(std::string_view english, int depth) {
    if (depth > kMostDepth) return std::string(english);
    if (const char* whole = translation(std::string(english).c_str())) return whole;
    for (const Translation& t : language_in_use().catalogue) {
        if (!std::strstr(t.english, "%s")) continue;
        if (const auto fields = match(t.english, english)) return filled(t.other, *fields, depth);
    }
    if (const auto parts = in_parts(english, depth)) return *parts;
    // The full stop of a message that is a part elsewhere.
    if (english.size() > 1 && english.back() == '.')
        return said(english.substr(0, english.size() - 1), depth + 1) + ".";
    return std::string(english);
}

std::string readable(std::string words) {
    for (char& c : words) {
        if (c == '_') c = ' ';
    }
    if (!words.empty())
        words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
    return words;
}

bool whole_number(std::string_view text) {
    if (text.empty()) return false;
    for (const char c : text) {
        if (!std::isdigit(static_cast<unsigned char>(c))) return false;
    }
    return true;
}

// "a_b_c" without its last part, which is put into `last`; false: there is one part alone.
bool split_last(std::string& name, std::string& last) {
    const std::size_t at = name.rfind('_');
    if (at == std::string::npos || at == 0) return false;
    last = name.substr(at + 1);
    name.resize(at);
    return true;
}

}  // namespace

std::string tr_said(const std::string& english) {
    if (language_in_use().catalogue.empty() || english.empty()) return english;
    return said(english, 0);
}

std::string tissue_words(const std::string& label) {
    const std::string english = readable(label);
    if (language_in_use().catalogue.empty()) return english;
    if (const char* whole = translation(english.c_str())) return whole;
    std::string base = label, last, end;
    if (!split_last(base, last)) return english;
    if (base == "vertebrae") return std::string(tr("Vertebra")) + " " + last;
    if (whole_number(last)) {
        end = " " + last;
        if (const char* known = translation(readable(base).c_str())) return known + end;
        if (!split_last(base, last)) return english;
    }
    if (last != "left" && last != "right") return english;
    const char* known = translation(readable(base).c_str());
    return known ? std::string(known) + " " + tr(last.c_str()) + end : english;
}

}  // namespace sonocase::runtime
