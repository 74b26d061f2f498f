// SPDX-License-Identifier: Apache-2.0

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

namespace sonocase::pipeline {

// A colour that depends on the name alone, so that a structure keeps it from case to case.
inline std::array<std::uint8_t, 3> label_colour(const std::string& name) {
    std::uint32_t hash = 2166136261u;  // FNV-1a
    for (const char c : name) hash = (hash ^ static_cast<std::uint8_t>(c)) * 16777619u;
    const double hue = static_cast<double>(hash % 360u) / 60.0;  // sixths of the circle
    const double low = 90 + static_cast<double>((hash >> 10) % 60u);
    const double high = 200 + static_cast<double>((hash >> 20) % 50u);
    std::array<std::uint8_t, 3> rgb{};
    for (int c = 0; c < 3; ++c) {
        double away = std::abs(hue - 2.0 * c);  // from the hue of this channel
        away = std::min(away, 6.0 - away);
        const double share = away <= 1 ? 1 : away >= 2 ? 0 : 2 - away;
        rgb[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(low + share * (high - low));
    }
    return rgb;
}

}  // namespace sonocase::pipeline
