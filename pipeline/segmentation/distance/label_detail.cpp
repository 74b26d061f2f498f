// SPDX-License-Identifier: Apache-2.0

// The part of label_distance.h that finds where a width is too wide, and blends finer ones in.
#include <algorithm>
#include <cstring>

#include "pipeline/segmentation/distance/label_distance.h"

namespace sonocase::pipeline {

std::vector<std::size_t> LabelDistance::find_strays(const LabelSet& labels,
                                                    const SparseBox& phi,
                                                    double tolerance_vx) const {
    const VoxelBox& box = phi.box();
    const float pixel = static_cast<float>(std::max(nodes_.spacing_mm.x, nodes_.spacing_mm.y));
    const float tolerance = static_cast<float>(tolerance_vx) * pixel;
    const Grid& g = labels_.grid;
    const std::ptrdiff_t step[3] = {1, g.size.x, static_cast<std::ptrdiff_t>(g.size.x) * g.size.y};
    std::array<bool, 256> member;
    for (std::size_t l = 0; l < member.size(); ++l) member[l] = labels[l];
    // A structure one voxel thick has no depth to lose. Between thick slices, shape interpolation
    // preserves thin structures.
    const auto limit_of = [&](Int3 v) {
        if (factor_ > 1) return tolerance;
        const std::uint8_t* at = labels_.voxels.data() + g.index(v.x, v.y, v.z);
        for (int a = 0; a < 3; ++a) {  // a label continues beyond the border
            if (v[a] == 0 || v[a] + 1 == g.size[a]) continue;
            const std::uint8_t before = at[-step[a]], after = at[step[a]];
            if (before != *at && after != *at) return 0.0f;
        }
        return tolerance;
    };
    std::vector<std::size_t> strays;
    for (int k = 0; k < box.size.z; ++k) {
        if ((box.first.z + k) % factor_ != 0) continue;  // only slices hold voxels of the map
        for (int j = 0; j < box.size.y; ++j) {
            const Int3 start{box.first.x, box.first.y + j, (box.first.z + k) / factor_};
            const std::uint8_t* row = labels_.voxels.data() + g.index(start.x, start.y, start.z);
            const std::size_t at = box.index(0, j, k);
            const std::uint32_t* states = phi.states().data() + phi.run_index(0, j, k);
            for (int r = 0; r < phi.runs(); ++r) {
                // A number stands where raw distances on all sides are at their limit, of one sign.
                // Those of slices that are interpolated may have another sign than the voxels.
                if (!SparseBox::stored(states[r]) && factor_ == 1) continue;
                const float* values = phi.values(states[r]);
                const int first = r * SparseBox::kRun;
                if (first + SparseBox::kRun <= box.size.x &&
                    std::memcmp(row + first, row + first + 1, SparseBox::kRun - 1) == 0) {
                    float low = values[0], high = values[0];
                    for (int i = 1; i < SparseBox::kRun; ++i) {
                        low = std::min(low, values[i]);
                        high = std::max(high, values[i]);
                    }
                    if (member[row[first]] ? high <= 0 : low >= 0) continue;
                }
                // Most runs that hold both sides have no voxel on the wrong one.
                const int end = std::min(first + SparseBox::kRun, box.size.x);
                unsigned wrong = 0;
                for (int i = first; i < end; ++i) {
                    const float value = values[i - first];
                    wrong |= member[row[i]] ? value > 0 : value < 0;
                }
                if (wrong == 0) continue;
                for (int i = first; i < end; ++i) {
                    const float value = values[i - first];
                    const float across = member[row[i]] ? value : -value;
                    if (across > 0 && across > limit_of({start.x + i, start.y, start.z}))
                        strays.push_back(at + static_cast<std::size_t>(i));
                }
            }
        }
    }
    return strays;
}

void LabelDistance::add_detail(const LabelSet& labels,
                               const SparseBox& raw,
                               std::size_t level,
                               SparseBox* phi,
                               Scratch* scratch) const {
    if (level + 1 >= levels_.size()) return;
    const VoxelBox box = phi->box();
    const std::vector<std::size_t> strays = find_strays(labels, *phi, levels_[level].tolerance_vx);
    if (strays.empty()) return;
    const Level& finer = levels_[level + 1];
    Int3 low = box.size, high{-1, -1, -1};
    for (const std::size_t s : strays) {
        const auto nx = static_cast<std::size_t>(box.size.x),
                   ny = static_cast<std::size_t>(box.size.y);
        const Int3 v{static_cast<int>(s % nx), static_cast<int>(s / nx % ny),
                     static_cast<int>(s / nx / ny)};
        for (int a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], v[a]);
            high[a] = std::max(high[a], v[a]);
        }
    }
    VoxelBox part;
    for (int a = 0; a < 3; ++a) {
        const int reach = levels_[level].spread.reach(a) + finer.kernels.reach(a);
        const int first = std::max(0, low[a] - reach);
        part.first[a] = box.first[a] + first;
        part.size[a] = std::min(box.size[a], high[a] + reach + 1) - first;
    }
    SparseBox &part_raw = scratch->part_raw[level], &fine = scratch->fine[level];
    crop(raw, part, &part_raw);
    smooth_sparse(part_raw, finer.kernels, &fine, &scratch->other);
    add_detail(labels, part_raw, level + 1, &fine, scratch);
    blend(levels_[level].spread, strays, fine, nullptr, phi, scratch);
}

void LabelDistance::blend(const BoxKernels& spread,
                          const std::vector<std::size_t>& strays,
                          const SparseBox& fine,
                          const NodeBlocks* needed,
                          SparseBox* phi,
                          Scratch* scratch) const {
    constexpr int kRun = SparseBox::kRun;
    const VoxelBox &box = phi->box(), &part = fine.box();
    const Int3 shift{part.first.x - box.first.x, part.first.y - box.first.y,
                     part.first.z - box.first.z};
    SparseBox &marked = scratch->marked, &weight = scratch->weight;
    marked.begin(part, 0, 0);
    const auto nx = static_cast<std::size_t>(box.size.x), ny = static_cast<std::size_t>(box.size.y);
    for (const std::size_t s : strays) {
        const int i = static_cast<int>(s % nx) - shift.x;
        marked.open(marked.run_index(i / kRun, static_cast<int>(s / nx % ny) - shift.y,
                                     static_cast<int>(s / nx / ny) - shift.z))[i % kRun] = 1;
    }
    smooth_sparse(marked, spread, &weight, &scratch->other, needed);
    for (int k = 0; k < part.size.z; ++k) {
        for (int j = 0; j < part.size.y; ++j) {
            for (int r = 0; r < fine.runs(); ++r) {
                const std::size_t run = fine.run_index(r, j, k);
                if (!SparseBox::stored(weight.states()[run])) continue;  // all zero
                const float* w = weight.values(weight.states()[run]);
                const float* from = fine.values(fine.states()[run]);
                const int end = std::min(kRun, part.size.x - r * kRun);
                for (int n = 0; n < end;) {  // up to the end of a run of phi at a time
                    const int i = shift.x + r * kRun + n;
                    float* to = phi->open(phi->run_index(i / kRun, shift.y + j, shift.z + k));
                    for (int m = i % kRun; m < kRun && n < end; ++m, ++n)
                        to[m] += std::min(1.0f, w[n]) * (from[n] - to[m]);
                }
            }
        }
    }
}

}  // namespace sonocase::pipeline
