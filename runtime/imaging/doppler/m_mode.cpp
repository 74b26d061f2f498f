// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/m_mode.h"

#include <algorithm>
#include <cmath>

#include "formats/base/random.h"

namespace sonocase::runtime::doppler {
namespace {

// Noise of the receiver in one emission, in grey levels. A picture's frames average it away; a
// column is one line, and nothing averages it. Below kFloor the machine rejects it.
constexpr double kNoise = 9, kFloor = 24;

double noise_of(std::int64_t k, int row) {
    const std::uint64_t bits =
        mix64(static_cast<std::uint64_t>(k) * kGoldenGamma + static_cast<std::uint64_t>(row) + 1);
    // Of two uniform numbers: a triangle over [-1, 1], of standard deviation 0.41.
    return (static_cast<double>(bits >> 48) + static_cast<double>(bits >> 32 & 0xFFFF)) / 65535 - 1;
}

}  // namespace

MMode::MMode(const ScanGeometry& geometry) : geometry_(geometry) {
    columns_.assign(kRows * kColumns, 0);
}

void MMode::advance(double line, double time_s, std::span<const std::uint8_t> grey) {
    if (!std::isfinite(time_s)) return;
    const auto now = static_cast<std::int64_t>(std::floor(time_s * kPerSecond + 1e-6));
    if (now < last_ || last_ < 0 || now - last_ > kColumns) {
        std::fill(columns_.begin(), columns_.end(), std::uint8_t{0});
        last_ = now - 1;
    }
    const double part = std::isfinite(line) ? std::clamp(line, 0.0, 1.0) : 0.5;
    const double beam = part * (geometry_.scanlines - 1);
    const PlanePoint from = geometry_.beam_origin(beam), d = geometry_.beam_direction(beam);
    for (; last_ < now; ++last_) {
        std::uint8_t* column = columns_.data() + (last_ + 1) % kColumns * kRows;
        double above = noise_of(last_ + 1, -1);
        for (int k = 0; k < kRows; ++k) {
            const double r = (k + 0.5) * mm_per_row();
            const double x = geometry_.origin_x_px + (from.x + r * d.x) / geometry_.mm_per_px,
                         y = geometry_.origin_y_px + (from.z + r * d.z) / geometry_.mm_per_px;
            const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
            if (i < 0 || j < 0 || i + 1 >= geometry_.width_px || j + 1 >= geometry_.height_px) {
                column[k] = 0;
                continue;
            }
            const auto at = [&](int a, int b) {
                return static_cast<double>(grey[static_cast<std::size_t>(b) * geometry_.width_px +
                                                static_cast<std::size_t>(a)]);
            };
            const double u = x - i, v = y - j;
            const double seen = (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) +
                                v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1));
            // A pulse is longer than a row: neighbours share half of their noise.
            const double noise = noise_of(last_ + 1, k);
            const double grain = kNoise * std::min(seen / kFloor, 1.0) * (noise + above);
            above = noise;
            column[k] = static_cast<std::uint8_t>(std::clamp(seen + grain, 0.0, 255.0) + 0.5);
        }
    }
}

}  // namespace sonocase::runtime::doppler
