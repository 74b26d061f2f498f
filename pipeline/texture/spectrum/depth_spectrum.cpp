// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/spectrum/depth_spectrum.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.141592653589793238463;

}  // namespace

std::vector<float> depth_spectrum(const CorrelationWidths& widths, bool across, int edge) {
    const auto n = static_cast<std::size_t>(edge);
    const double angle = widths.angle_rad + (across ? kPi / 2 : 0.0);
    // Correlation length from the full width at half height: of exp(-r / l), or of
    // (1 + r / l) exp(-r / l).
    const double width = std::max(across ? widths.across : widths.along, 0.8);
    const double length = across ? width / 1.386 : width / 3.357;
    const auto lowest = static_cast<float>(1 / (length * length));
    std::vector<float> share(n * n * n);
    const auto wave = [&](std::size_t k) {
        const int signed_k = static_cast<int>(k) - (k > n / 2 ? edge : 0);
        return 2 * kPi * signed_k / edge;
    };
    std::vector<float> kz2(n);
    for (std::size_t z = 0; z < n; ++z) kz2[z] = static_cast<float>(wave(z) * wave(z));
    for (std::size_t i = 0; i < n * n; ++i) {
        const double k = wave(i % n) * std::cos(angle) + wave(i / n) * std::sin(angle);
        const float base = lowest + static_cast<float>(k * k);
        float sum = 0;
        for (std::size_t z = 0; z < n; ++z) {
            const float q = base + kz2[z];
            const float s = 1 / (q * (across ? 1.f : q) * std::sqrt(q));
            share[z * n * n + i] = s;
            sum += s;
        }
        const float scale = static_cast<float>(edge) / sum;
        for (std::size_t z = 0; z < n; ++z) share[z * n * n + i] *= scale;
    }
    return share;
}

}  // namespace sonocase::pipeline
