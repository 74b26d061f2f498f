// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/boundary_layers.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline::inline anatomy {
namespace {

constexpr float kFasciaEchoDb = 9;  // re liver; tissue table: fascia +10 (assumed)

// Signed distance, in voxels, from a boundary with the share p in (0, 1) of the neighbourhood on
// this side, after smoothing with standard deviation sigma: the normal quantile (rational form,
// error 4e-4).
float distance_from_share(float p, float sigma) {
    const float q = std::min(p, 1 - p);
    if (q < 1e-3f) return p < 0.5f ? -3.1f * sigma : 3.1f * sigma;
    const float t = std::sqrt(-2 * std::log(q));
    const float z = t - (2.515517f + t * (0.802853f + t * 0.010328f)) /
                            (1 + t * (1.432788f + t * (0.189269f + t * 0.001308f)));
    return p < 0.5f ? -sigma * z : sigma * z;
}

}  // namespace

void BoundaryLayers::smooth(std::vector<std::uint16_t>& volume) {
    // 1 4 6 4 1 along each axis, which fits into 16 bits: 16^3 = 4096 at most. The outermost two
    // samples of the rim stay unfiltered; they are not used.
    scratch_.resize(volume.size());
    for (int axis = 0; axis < 3; ++axis) {
        const std::size_t stride = axis == 0 ? 1 : axis == 1 ? kSide : kSide * kSide;
        const std::size_t count = volume.size() - 4 * stride;
        const std::uint16_t* in = volume.data();
        std::uint16_t* to = scratch_.data() + 2 * stride;
        for (std::size_t i = 0; i < count; ++i) {
            to[i] = static_cast<std::uint16_t>(in[i] + in[i + 4 * stride] +
                                               4 * (in[i + stride] + in[i + 3 * stride]) +
                                               6 * in[i + 2 * stride]);
        }
        volume.swap(scratch_);
    }
}

void BoundaryLayers::prepare(const LabelVolume& labels,
                             Int3 lower,
                             Int3 upper,
                             const BoundaryLayerRules& rules) {
    rules_ = &rules;
    lower_ = lower;
    fascia_ = wall_ = false;
    // Most blocks hold a single label, or none that has layers.
    std::array<bool, 256> seen{};
    const Int3 size = labels.grid.size;
    for (int k = std::max(lower.z - 2, 0); k < std::min(upper.z + 2, size.z); ++k) {
        for (int j = std::max(lower.y - 2, 0); j < std::min(upper.y + 2, size.y); ++j) {
            const std::uint8_t* row = labels.voxels.data() + labels.grid.index(0, j, k);
            for (int i = std::max(lower.x - 2, 0); i < std::min(upper.x + 2, size.x); ++i) {
                seen[row[i]] = true;
            }
        }
    }
    bool muscle = false, bowel = false;
    int soft = 0, kinds = 0;
    std::vector<std::uint8_t> present;
    for (std::size_t l = 0; l < rules.role.size(); ++l) {
        if (!seen[l]) continue;
        present.push_back(static_cast<std::uint8_t>(l));
        ++kinds;
        muscle |= rules.role[l] == StructureRole::muscle;
        bowel |= rules.role[l] == StructureRole::bowel;
        soft += rules.role[l] == StructureRole::muscle || rules.role[l] == StructureRole::fat;
    }
    const bool want_fascia = rules.fascia && muscle && soft >= 2;
    // A block deep in one bowel loop may still be within reach of its wall; find_walls sees that.
    const bool want_wall = rules.bowel_wall && bowel;
    if (!want_fascia && !(want_wall && kinds >= 1)) return;
    labels_.resize(static_cast<std::size_t>(kSide) * kSide * kSide);
    for (int k = 0; k < kSide; ++k) {
        const int z = std::clamp(lower.z + k - kRim, 0, size.z - 1);
        for (int j = 0; j < kSide; ++j) {
            const int y = std::clamp(lower.y + j - kRim, 0, size.y - 1);
            const std::uint8_t* row = labels.voxels.data() + labels.grid.index(0, y, z);
            std::uint8_t* to = labels_.data() + index(0, j, k);
            for (int i = 0; i < kSide; ++i)
                to[i] = row[std::clamp(lower.x + i - kRim, 0, size.x - 1)];
        }
    }
    if (want_fascia) find_fascia(present);
    if (want_wall) find_walls(present);
}

void BoundaryLayers::find_fascia(const std::vector<std::uint8_t>& present) {
    fascia_ = true;
    const std::size_t count = labels_.size();
    fascia_distance_.assign(count, 9.f);
    all_.resize(count);
    share_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        const StructureRole r = rules_->role[labels_[i]];
        all_[i] = r == StructureRole::muscle || r == StructureRole::fat;
    }
    smooth(all_);
    for (const std::uint8_t label : present) {
        if (rules_->role[label] != StructureRole::muscle) continue;
        bool uniform = true;
        for (std::size_t i = 0; i < count; ++i) {
            share_[i] = labels_[i] == label;
            uniform &= share_[i] != 0;
        }
        if (uniform) continue;
        smooth(share_);
        for (int k = 2; k < kSide - 2; ++k) {
            for (int j = 2; j < kSide - 2; ++j) {
                for (int i = 2; i < kSide - 2; ++i) {
                    const std::size_t at = index(i, j, k);
                    // Only where muscle and fat fill the neighbourhood: bone, skin and organs have
                    // surfaces of their own.
                    if (share_[at] == 0 || share_[at] == all_[at] || all_[at] < 2900) continue;
                    const float p = static_cast<float>(share_[at]) / static_cast<float>(all_[at]);
                    const float d = std::abs(distance_from_share(p, 1.0f));
                    fascia_distance_[at] = std::min(fascia_distance_[at], d);
                }
            }
        }
    }
}

float BoundaryLayers::fascia_db(
    float db, std::uint8_t label, float distance_vx, float coarse, float fine) const {
    const auto voxel = static_cast<float>(rules_->voxel_mm);
    const float half_mm = 0.5f * std::clamp(1.0f + 0.3f * coarse, 0.5f, 1.5f);
    const float cover = std::clamp((half_mm - distance_vx * voxel) / voxel + 0.5f, 0.f, 1.f);
    if (cover <= 0) return db;
    const float target = kFasciaEchoDb + 2.0f * fine - rules_->echo_db[label];
    return db + cover * (target - db);
}

// Distances to the samples that are 0, in voxels, in two sweeps over the block; the outermost
// samples stay as they are.
void BoundaryLayers::chamfer(std::vector<float>* distance) {
    std::vector<float>& d = *distance;
    constexpr float kSteps[4] = {0, 1, 1.41f, 1.73f};
    constexpr int kInner = kSide - 2;
    for (const int sign : {1, -1}) {
        for (int n = 0; n < kInner * kInner * kInner; ++n) {
            const int m = sign > 0 ? n : kInner * kInner * kInner - 1 - n;
            const int i = 1 + m % kInner, j = 1 + m / kInner % kInner, k = 1 + m / kInner / kInner;
            const std::size_t at = index(i, j, k);
            float best = d[at];
            if (best == 0) continue;
            for (int c = -1; c <= 0; ++c) {
                for (int b = -1; b <= (c < 0 ? 1 : 0); ++b) {
                    for (int a = -1; a <= (c < 0 || b < 0 ? 1 : -1); ++a) {
                        const float step = kSteps[std::abs(a) + std::abs(b) + std::abs(c)];
                        best = std::min(best,
                                        d[index(i + sign * a, j + sign * b, k + sign * c)] + step);
                    }
                }
            }
            d[at] = best;
        }
    }
}

void BoundaryLayers::find_walls(const std::vector<std::uint8_t>& present) {
    const std::size_t count = labels_.size();
    wall_depth_.assign(count, 9.f);
    const auto voxel = static_cast<float>(rules_->voxel_mm);
    constexpr float kFar = 1e3f;
    for (const std::uint8_t label : present) {
        if (rules_->role[label] != StructureRole::bowel) continue;
        // Chamfer distance to voxels that are neither this bowel nor gas, in two sweeps.
        std::vector<float> d(count);
        bool outside = false;
        for (std::size_t i = 0; i < count; ++i) {
            const bool in = labels_[i] == label || rules_->gas[labels_[i]];
            d[i] = in ? kFar : 0;
            outside |= !in;
        }
        if (!outside) continue;
        wall_ = true;
        chamfer(&d);
        for (std::size_t i = 0; i < count; ++i) {
            if (labels_[i] == label) wall_depth_[i] = (d[i] - 0.5f) * voxel;
        }
    }
}

// From outside in: the interface of serosa and fat is bright, muscularis dark, submucosa bright,
// mucosa dark, each about 1 mm thick as in endosonography; then the contents.
float BoundaryLayers::wall_db(float contents, float depth_mm) const {
    constexpr float kLevels[4] = {4, -8, 6, -7};
    const float s = std::max(depth_mm - 0.5f, 0.f);  // 0 at the centre of the first layer
    const int layer = static_cast<int>(s);
    if (layer >= 4) return contents;
    const float t = s - static_cast<float>(layer);
    const float next = layer < 3 ? kLevels[layer + 1] : contents;
    return kLevels[layer] + t * (next - kLevels[layer]);
}

}  // namespace sonocase::pipeline::inline anatomy
