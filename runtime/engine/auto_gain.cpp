// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/auto_gain.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::runtime::inline engine {

void adjust_gain(std::span<const std::uint8_t> pixels,
                 int width_px,
                 const Renderer::Layout& layout,
                 double depth_mm,
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
    const double db_per_level = settings.dynamic_range_db / 255;
    double all = 0, n = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        all += sum[i];
        n += count[i];
    }
    if (n < 1) return;
    const double middle = all / n;
    settings.gain_db =
        std::clamp(settings.gain_db + std::round((kWanted - middle) * db_per_level), -30.0, 30.0);
    for (std::size_t i = 0; i < 8; ++i) {
        if (count[i] < 50) continue;
        const double by = (middle - sum[i] / count[i]) * db_per_level;
        settings.tgc_db[i] = std::clamp(std::round(settings.tgc_db[i] + 0.5 * by), -20.0, 20.0);
    }
}

}  // namespace sonocase::runtime::inline engine
