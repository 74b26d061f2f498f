// SPDX-License-Identifier: Apache-2.0

// A set of labels of a label volume, by palette index.
#pragma once

#include <bitset>
#include <cstdint>

namespace sonocase::pipeline::inline base {

using LabelSet = std::bitset<256>;

inline LabelSet one_label(std::uint8_t label) {
    LabelSet set;
    set.set(label);
    return set;
}

}  // namespace sonocase::pipeline::inline base
