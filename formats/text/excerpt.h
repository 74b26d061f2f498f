// SPDX-License-Identifier: Apache-2.0

// The first of a list that may be long, for a sentence.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>

namespace sonocase {

// "liver, spleen, heart, aorta and 3 more". max_named: how many are named.
inline std::string excerpt(std::span<const std::string> items, std::size_t max_named = 4) {
    std::string text;
    for (std::size_t n = 0; n < std::min(max_named, items.size()); ++n)
        text += (n > 0 ? ", " : "") + items[n];
    if (items.size() > max_named)
        text += " and " + std::to_string(items.size() - max_named) + " more";
    return text;
}

}  // namespace sonocase
