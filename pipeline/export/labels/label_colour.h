// SPDX-License-Identifier: Apache-2.0

// Colours of labels in pictures and in files for other tools: the same in all of them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

// sRGB. A label's own colour; a label without one (black) gets a hue a golden angle away from its
// neighbours' in the palette, alternately light and dark. The outside is nearly black.
inline std::array<std::uint8_t, 3> colour_of(const std::vector<Label>& labels, int label) {
    if (label <= 0) return {18, 18, 18};
    const auto own = labels[static_cast<std::size_t>(label)].colour;
    if (own != std::array<std::uint8_t, 3>{0, 0, 0}) return own;
    const double hue = std::fmod(0.61803398875 * label, 1.0) * 6;
    const double dark = label % 2 == 0 ? 0.2 : 0.45, light = label % 2 == 0 ? 0.75 : 1;
    std::array<std::uint8_t, 3> colour;
    for (std::size_t c = 0; c < 3; ++c) {
        const double d = std::abs(std::fmod(hue + 2.0 * static_cast<double>(c), 6.0) - 3);
        colour[c] = static_cast<std::uint8_t>(
            std::lround(255 * (dark + (light - dark) * std::clamp(d - 1, 0.0, 1.0))));
    }
    return colour;
}

}  // namespace sonocase::pipeline
