// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/auto_gain.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::runtime::inline engine {
namespace {

// The gain that turns one mean grey into another.
double gain_between(double from, double to, const GainLaw& law, double range_db) {
    if (law.exponent <= 0) return (to - from) * range_db / 255;
    const double exponent =
        law.range_db > 0 ? law.exponent * law.range_db / range_db : law.exponent;
    return 20 / exponent *
           std::log10(std::max(to - law.black, 1.0) / std::max(from - law.black, 1.0));
}

}  // namespace

void adjust_gain(std::span<const std::uint8_t> pixels,
                 int width_px,
                 const Renderer::Layout& layout,
                 double depth_mm,
                 const GainLaw& law,
                 ImageSettings& settings) {
    if (width_px <= 0) return;
    const int height_px = static_cast<int>(pixels.size()) / width_px;
    // Means of the eight depths where there is an echo at all; a level of 255 is the whole range.
    std::array<double, 8> sum{}, count{};
    for (int y = 0; y < height_px; ++y) {
        const double depth = (y - layout.origin_y_px) * layout.mm_per_px;
        const int row = static_cast<int>(8 * depth / std::max(depth_mm, 1.0));
        if (depth < 0 || row > 7) continue;
        for (int x = width_px / 3; x < 2 * width_px / 3; ++x) {
            const int level = pixels[static_cast<std::size_t>(y) * width_px + x];
            if (level < 30) continue;  // fluid, shadow and what a machine shows of no echo
            sum[row] += level;
            count[row] += 1;
        }
    }
    constexpr double kWanted = 95;
    double all = 0, n = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        all += sum[i];
        n += count[i];
    }
    if (n < 1) return;
    const double middle = all / n;
    const auto gain = [&](double from, double to) {
        return gain_between(from, to, law, settings.dynamic_range_db);
    };
    settings.gain_db =
        std::clamp(settings.gain_db + std::round(gain(middle, kWanted)), -30.0, 30.0);
    for (std::size_t i = 0; i < 8; ++i) {
        if (count[i] < 50) continue;
        const double by = gain(sum[i] / count[i], middle);
        settings.tgc_db[i] = std::clamp(std::round(settings.tgc_db[i] + 0.5 * by), -20.0, 20.0);
    }
}

}  // namespace sonocase::runtime::inline engine
