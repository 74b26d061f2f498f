// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/muscle_fibres.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline::inline anatomy {

Vector3 MuscleDirections::at(int label, float i, float j, float k) const {
    const FibreField& f = fields[label];
    if (!f.sheet || skin_depth == nullptr) return f.axis;
    const Vector3 inward = skin_depth->gradient(i, j, k);
    const Vector3 round = cross(up, inward);
    const double size = norm(round);
    if (size < 0.2) return f.axis;  // on the medial axis, or where the skin is horizontal
    // Radians from the horizontal, between those of the three layers.
    constexpr double kSlant = 0.5;
    return std::cos(kSlant) / size * round + std::sin(kSlant) * up;
}

MuscleDirections find_muscle_directions(const LabelVolume& labels,
                                        const std::vector<LabelFacts>& facts,
                                        const CoarseField* skin_depth) {
    MuscleDirections out;
    out.skin_depth = skin_depth;
    out.fields.resize(facts.size());
    // The spine gives the direction of `up`; without two vertebrae it is k.
    Vector3 lowest{}, highest{};
    double vertebrae = 0;
    for (std::size_t l = 1; l < facts.size(); ++l) {
        const std::string& name = labels.labels[l].name;
        if (facts[l].count == 0 || name.rfind("vertebra", 0) != 0) continue;
        if (vertebrae == 0 || norm(facts[l].mean - lowest) > norm(highest - lowest)) {
            if (vertebrae == 0) lowest = facts[l].mean;
            highest = facts[l].mean;
        }
        vertebrae += 1;
    }
    if (vertebrae >= 2 && norm(highest - lowest) > 1) {
        const Vector3 along = normalized(highest - lowest);
        out.up = along.z < 0 ? -along : along;
    }
    for (std::size_t l = 1; l < facts.size(); ++l) {
        if (facts[l].role != StructureRole::muscle) continue;
        FibreField& f = out.fields[l];
        f.label = static_cast<int>(l);
        f.axis = facts[l].axes.column(0);
        if (f.axis.z < 0) f.axis = -f.axis;
        // A muscle with a belly is longer than wide; a sheet around the body spreads like the body.
        f.sheet = facts[l].spread.x < 1.6 * facts[l].spread.y && skin_depth != nullptr;
    }
    return out;
}

namespace {

constexpr float kSpacingMm = 1.3f;  // of the samples along a fibre

}  // namespace

FibreNoise::FibreNoise(double voxel_mm, std::uint64_t seed)
    : noise_(std::max(1.6, 2.0 * voxel_mm), seed) {
    double square = 0;
    for (int t = -kReach; t <= kReach; ++t) {
        weight_[t + kReach] =
            static_cast<float>(std::exp(-0.5 * t * t * kSpacingMm * kSpacingMm / (2.6 * 2.6)));
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
    const auto dx = static_cast<float>(along.x) * kSpacingMm;
    const auto dy = static_cast<float>(along.y) * kSpacingMm;
    const auto dz = static_cast<float>(along.z) * kSpacingMm;
    for (int t = -kReach; t <= kReach; ++t) {
        const auto s = static_cast<float>(t);
        sum += weight_[t + kReach] * noise_.at(x + s * dx, y + s * dy, z + s * dz);
    }
    return sum;
}

}  // namespace sonocase::pipeline::inline anatomy
