// SPDX-License-Identifier: Apache-2.0

// The first of a list that may be long, for a sentence.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>

namespace sonocase {

// "liver, spleen, heart, aorta and 3 more". most: of the items named.
inline std::string excerpt(std::span<const std::string> items, std::size_t most = 4) {
    std::string text;
    for (std::size_t n = 0; n < std::min(most, items.size()); ++n)
        text += (n > 0 ? ", " : "") + items[n];
    if (items.size() > most) text += " and " + std::to_string(items.size() - most) + " more";
    return text;
}

}  // namespace sonocase
