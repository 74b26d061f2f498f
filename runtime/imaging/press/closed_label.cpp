// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/closed_label.h"

#include <algorithm>

#include "formats/volume/tissue_mechanics.h"

namespace sonocase::runtime::press {
namespace {

using Counts = std::vector<std::vector<std::int64_t>>;  // [draining label][label beside it]

// Neighbours inside every `every`-th brick of the pool.
Counts count_neighbours(const BrickVolume<std::uint8_t>& labels,
                        const std::vector<bool>& drains,
                        std::size_t every) {
    Counts counts(drains.size());
    for (std::size_t l = 0; l < drains.size(); ++l)
        if (drains[l]) counts[l].assign(drains.size(), 0);
    for (std::size_t at = 0; at + kBrickVoxels <= labels.pool.size(); at += every * kBrickVoxels) {
        const std::uint8_t* brick = labels.pool.data() + at;
        for (std::size_t n = 0; n < kBrickVoxels; ++n) {
            if (!drains[brick[n]]) continue;
            for (std::size_t step = 1; step < kBrickVoxels; step *= kBrickEdge) {
                const std::size_t along = n / step % kBrickEdge;
                if (along > 0) ++counts[brick[n]][brick[n - step]];
                if (along + 1 < kBrickEdge) ++counts[brick[n]][brick[n + step]];
            }
        }
    }
    return counts;
}

}  // namespace

std::vector<std::int32_t> closed_labels(const CaseBundle& bundle) {
    const std::size_t count = bundle.labels.size();
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    // Padded to every byte, so that a damaged voxel finds a place.
    std::vector<bool> drains(256, false), soft(256, false);
    std::vector<std::int32_t> out(256);
    for (std::size_t l = 0; l < out.size(); ++l) out[l] = static_cast<std::int32_t>(l);
    bool any = false;
    for (std::size_t l = 0; l < count && l < drains.size(); ++l) {
        if (tissue_of[l] < 0) continue;
        const Tissue& tissue = bundle.tissues[static_cast<std::size_t>(tissue_of[l])];
        drains[l] = mechanics_of(tissue, bundle.labels[l].name).drains;
        soft[l] = tissue.kind == TissueKind::soft && !drains[l];
        any = any || drains[l];
    }
    if (!any) return out;
    for (const std::size_t every : {std::size_t{4}, std::size_t{1}}) {
        const Counts counts = count_neighbours(bundle.label_bricks, drains, every);
        bool complete = true;
        for (std::size_t l = 0; l < count && l < drains.size(); ++l) {
            if (!drains[l]) continue;
            std::int64_t most = 0;
            for (std::size_t beside = 0; beside < count; ++beside) {
                if (!soft[beside] || counts[l][beside] <= most) continue;
                most = counts[l][beside];
                out[l] = static_cast<std::int32_t>(beside);
            }
            complete = complete && most > 0;
        }
        if (complete) break;
    }
    return out;
}

}  // namespace sonocase::runtime::press
