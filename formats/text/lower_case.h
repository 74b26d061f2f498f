// SPDX-License-Identifier: Apache-2.0

// Letters in lower case, in any language of the system.
#pragma once

#include <string>
#include <string_view>

namespace sonocase {

inline char lower_case(char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

// ASCII letters alone; other bytes stay.
inline std::string lower_case(std::string_view text) {
    std::string lower(text);
    for (char& c : lower) c = lower_case(c);
    return lower;
}

}  // namespace sonocase
