// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/auto_gain.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::runtime::inline engine {
namespace {

constexpr int kEcho = 30;  // below: fluid, shadow and what a machine shows of no echo
constexpr double kWanted = 95;

double exponent_at(const GainLaw& law, double range_db) {
    return law.range_db > 0 ? law.exponent * law.range_db / range_db : law.exponent;
}

// The gain that turns one mean grey into another.
double gain_between(double from, double to, const GainLaw& law, double range_db) {
    if (law.exponent <= 0) return (to - from) * range_db / 255;
    return 20 / exponent_at(law, range_db) *
           std::log10(std::max(to - law.black, 1.0) / std::max(from - law.black, 1.0));
}

// What a grey becomes with so much more gain.
double grey_after(double grey, double db, const GainLaw& law, double range_db) {
    if (law.exponent <= 0) return std::clamp(grey + 255 * db / range_db, 0.0, 255.0);
    const bool bent = law.knee_slope > 0 && grey > law.knee;
    const double straight = bent ? law.knee + (grey - law.knee) / law.knee_slope : grey;
    const double factor = std::pow(10, exponent_at(law, range_db) * db / 20);
    double after = law.black + std::max(straight - law.black, 0.0) * factor;
    if (after > law.knee) after = law.knee + law.knee_slope * (after - law.knee);
    return std::clamp(after, 0.0, 255.0);
}

// The whole decibels after which the mean of a picture's echoes is nearest to what is wanted. Each
// grey is followed by itself, since the knee bends the bright ones; beyond the knee, where fasciae,
// bone and gas lie, it counts as the knee.
double gain_wanted(const std::array<double, 256>& count, const GainLaw& law, double range_db) {
    double best_db = 0, best = 1e9;
    for (int step = 0; step <= 120; ++step) {
        const double db = step % 2 == 0 ? step / 2 : -(step + 1) / 2;
        double sum = 0, n = 0;
        for (int level = kEcho; level < 256; ++level) {
            const double times = count[static_cast<std::size_t>(level)];
            if (times > 0) sum += times * std::min(grey_after(level, db, law, range_db), law.knee);
            n += times;
        }
        if (n > 0 && std::abs(sum / n - kWanted) < best) {
            best = std::abs(sum / n - kWanted);
            best_db = db;
        }
    }
    return best_db;
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
    std::array<double, 256> of_level{};
    for (int y = 0; y < height_px; ++y) {
        const double depth = (y - layout.origin_y_px) * layout.mm_per_px;
        const int row = static_cast<int>(8 * depth / std::max(depth_mm, 1.0));
        if (depth < 0 || row > 7) continue;
        for (int x = width_px / 3; x < 2 * width_px / 3; ++x) {
            const int level = pixels[static_cast<std::size_t>(y) * width_px + x];
            if (level < kEcho) continue;
            of_level[static_cast<std::size_t>(level)] += 1;
            sum[row] += level;
            count[row] += 1;
        }
    }
    double all = 0, n = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        all += sum[i];
        n += count[i];
    }
    if (n < 1) return;
    const double middle = all / n;
    const double range_db = settings.dynamic_range_db;
    settings.gain_db =
        std::clamp(settings.gain_db + gain_wanted(of_level, law, range_db), -30.0, 30.0);
    for (std::size_t i = 0; i < 8; ++i) {
        if (count[i] < 50) continue;
        const double by = gain_between(sum[i] / count[i], middle, law, range_db);
        settings.tgc_db[i] = std::clamp(std::round(settings.tgc_db[i] + 0.5 * by), -20.0, 20.0);
    }
}

}  // namespace sonocase::runtime::inline engine
