// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure/fibre_noise.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline {
namespace {

constexpr float kSpacing_mm = static_cast<float>(1.3);  // of the samples along a fibre

}  // namespace

FibreNoise::FibreNoise(double voxel_mm, std::uint64_t seed)
    : noise_(std::max(1.6, 2.0 * voxel_mm), seed) {
    double square = 0;
    for (int t = -kReach; t <= kReach; ++t) {
        weight_[static_cast<std::size_t>(t + kReach)] =
            static_cast<float>(std::exp(-0.5 * t * t * kSpacing_mm * kSpacing_mm / (2.6 * 2.6)));
    }
    // The variance is measured, because the samples overlap.
    constexpr int kProbes = 4096;
    for (std::uint64_t i = 0; i < kProbes; ++i) {
        const auto x = [&](std::uint64_t a) {
            return static_cast<float>(400 * uniform_at(seed, 3 * i + a));
        };
        const float v = at(x(0), x(1), x(2), {0.48, 0.6, 0.64});
        square += static_cast<double>(v) * v / kProbes;
    }
    for (float& w : weight_) w /= static_cast<float>(std::sqrt(square));
}

float FibreNoise::at(float x, float y, float z, Vector3 along) const {
    float sum = 0;
    const auto dx = static_cast<float>(along.x) * kSpacing_mm;
    const auto dy = static_cast<float>(along.y) * kSpacing_mm;
    const auto dz = static_cast<float>(along.z) * kSpacing_mm;
    for (int t = -kReach; t <= kReach; ++t) {
        const auto s = static_cast<float>(t);
        sum += weight_[static_cast<std::size_t>(t + kReach)] *
               noise_.at(x + s * dx, y + s * dy, z + s * dz);
    }
    return sum;
}

}  // namespace sonocase::pipeline
