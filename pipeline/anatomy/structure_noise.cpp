// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure_noise.h"

#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/base/periodic_volume.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

constexpr int kEdge = 64;
// Rotation about (1, 2, 3) by one radian: none of its entries is near 0 or 1.
constexpr float kRotation[9] = {0.573138f,  -0.609007f, 0.548292f, 0.740349f, 0.671645f,
                                -0.027879f, -0.351279f, 0.421906f, 0.835822f};

}  // namespace

StructureNoise::StructureNoise(double grain_mm, std::uint64_t seed) {
    std::vector<float> cells(static_cast<std::size_t>(kEdge) * kEdge * kEdge);
    for (std::size_t i = 0; i < cells.size(); i += 2) {
        const GaussianPair z = gaussian_pair_at(seed, i / 2);
        cells[i] = static_cast<float>(z.a);
        cells[i + 1] = static_cast<float>(z.b);
    }
    lowpass_periodic(cells, kEdge, 1);  // deviation of the kernel 1 cell: grain 3.33 cells
    double square = 0;
    for (const float c : cells) square += static_cast<double>(c) * c;
    const auto unit = static_cast<float>(1 / std::sqrt(square / static_cast<double>(cells.size())));
    for (float& c : cells) c *= unit;
    cells_ = std::move(cells);
    scale_ = static_cast<float>(3.33 / grain_mm);
}

float StructureNoise::at(float x, float y, float z) const {
    const float p[3] = {scale_ * (kRotation[0] * x + kRotation[1] * y + kRotation[2] * z) + 4096.f,
                        scale_ * (kRotation[3] * x + kRotation[4] * y + kRotation[5] * z) + 4096.f,
                        scale_ * (kRotation[6] * x + kRotation[7] * y + kRotation[8] * z) + 4096.f};
    const int i = static_cast<int>(p[0]), j = static_cast<int>(p[1]), k = static_cast<int>(p[2]);
    const float u = p[0] - static_cast<float>(i), v = p[1] - static_cast<float>(j),
                w = p[2] - static_cast<float>(k);
    constexpr int kMask = kEdge - 1;
    const int i0 = i & kMask, i1 = (i + 1) & kMask;
    const int j0 = (j & kMask) * kEdge, j1 = ((j + 1) & kMask) * kEdge;
    const int k0 = (k & kMask) * kEdge * kEdge, k1 = ((k + 1) & kMask) * kEdge * kEdge;
    const float* c = cells_.data();
    const auto mix = [](float a, float b, float t) { return a + t * (b - a); };
    const float low =
        mix(mix(c[i0 + j0 + k0], c[i1 + j0 + k0], u), mix(c[i0 + j1 + k0], c[i1 + j1 + k0], u), v);
    const float high =
        mix(mix(c[i0 + j0 + k1], c[i1 + j0 + k1], u), mix(c[i0 + j1 + k1], c[i1 + j1 + k1], u), v);
    return mix(low, high, w);
}

}  // namespace sonocase::pipeline::inline anatomy
