// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/label_distance.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sonocase::pipeline {
namespace {

constexpr double kWide = 1.76, kMiddle = 0.59;  // widths, in sigma

// Bounding box of both.
VoxelBox united(const VoxelBox& a, const VoxelBox& b) {
    if (a.empty()) return b;
    if (b.empty()) return a;
    VoxelBox out;
    for (int i = 0; i < 3; ++i) {
        out.first[i] = std::min(a.first[i], b.first[i]);
        out.size[i] = std::max(a.first[i] + a.size[i], b.first[i] + b.size[i]) - out.first[i];
    }
    return out;
}

// `part` grown by `nodes` on each side and cut to `whole`.
VoxelBox grown_within(const VoxelBox& part, Int3 nodes, const VoxelBox& whole) {
    VoxelBox out;
    for (int a = 0; a < 3; ++a) {
        out.first[a] = std::max(whole.first[a], part.first[a] - nodes[a]);
        const int end =
            std::min(whole.first[a] + whole.size[a], part.first[a] + part.size[a] + nodes[a]);
        out.size[a] = end - out.first[a];
    }
    return out;
}

Int3 larger(Int3 a, Int3 b) {
    return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

Int3 sum(Int3 a, Int3 b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}

// The axis of the largest spacing.
int slice_axis(const Grid& g) {
    int thick = 2;
    for (const int a : {1, 0}) {
        if (g.spacing_mm[a] > g.spacing_mm[thick] * 1.0001) thick = a;
    }
    return thick;
}

Int3 reach_of(const BoxKernels& kernels) {
    return {kernels.reach(0), kernels.reach(1), kernels.reach(2)};
}

}  // namespace

LabelVolume slices_last(const LabelVolume& labels) {
    const Grid& g = labels.grid;
    const int thick = slice_axis(g);
    if (thick == 2) return labels;
    // A cyclic exchange of axes keeps the frame right-handed.
    const int from[3] = {(thick + 1) % 3, (thick + 2) % 3, thick};
    LabelVolume out;
    out.labels = labels.labels;
    out.grid.origin_mm = g.origin_mm;
    for (int a = 0; a < 3; ++a) {
        out.grid.size[a] = g.size[from[a]];
        out.grid.spacing_mm[a] = g.spacing_mm[from[a]];
        for (int r = 0; r < 3; ++r) out.grid.direction(r, a) = g.direction(r, from[a]);
    }
    out.voxels.resize(g.voxel_count());
    for (int k = 0; k < out.grid.size.z; ++k) {
        for (int j = 0; j < out.grid.size.y; ++j) {
            for (int i = 0; i < out.grid.size.x; ++i) {
                Int3 v;
                v[from[0]] = i;
                v[from[1]] = j;
                v[from[2]] = k;
                out.voxels[out.grid.index(i, j, k)] = labels.voxels[g.index(v.x, v.y, v.z)];
            }
        }
    }
    return out;
}

LabelDistance::LabelDistance(const LabelVolume& labels, const LabelDistanceOptions& options)
    : turned_(slice_axis(labels.grid) == 2 ? nullptr
                                           : std::make_unique<LabelVolume>(slices_last(labels))),
      labels_(turned_ ? *turned_ : labels),
      options_(options) {
    const Vector3 h = labels_.grid.spacing_mm;
    const double pixel = std::max(h.x, h.y);
    nodes_ = labels_.grid;
    if (options_.shape_slices && h.z >= options_.thick_ratio * pixel && labels_.grid.size.z > 1) {
        factor_ = std::max(2, static_cast<int>(std::lround(h.z / pixel)));
        nodes_.spacing_mm.z = h.z / factor_;
        nodes_.size.z = (labels_.grid.size.z - 1) * factor_ + 1;
        groups_ = find_slice_groups(labels_);
        limit_mm_ = 4 * h.z;
    } else {
        limit_mm_ = (4 + 2 * options_.sigma_vx) * pixel;
    }
    boxes_ = label_boxes(labels_);
    const double sigma = options_.sigma_vx;
    if (sigma <= 0) return;
    add_level(sigma, options_.tolerance_vx);
    for (const double finer : {kMiddle * sigma, options_.detail_vx}) {
        if (finer < sigma && (levels_.size() == 1 || finer < kMiddle * sigma))
            add_level(finer, options_.tolerance_vx);
    }
    const double more = std::sqrt(kWide * kWide - 1) * sigma;
    for (int a = 0; a < 3; ++a) {
        if (nodes_.size[a] < 2) continue;
        const auto u = static_cast<std::size_t>(a);
        // Between distant slices only their steps remain to be flattened, which takes a width of at
        // least one slice.
        const double taps = std::max(more * nodes_per_vx(a), thick(a) ? 1.0 * factor_ : 0.0);
        // Values that have been smoothed once are resolved by every second node.
        wide_.kernels.stride[u] = taps > 2.4 ? 2 : 1;
        wide_.kernels.taps[u] = smoothing_kernel(taps / wide_.kernels.stride[u]);
        wide_.spread.taps[u] =
            spreading_kernel(thick(a) ? 0.5 * factor_ : std::max(0.8, 0.7 * taps));
    }
    wide_.tolerance_vx = options_.wide_tolerance_vx;
}

double LabelDistance::nodes_per_vx(int axis) const {
    const Vector3 h = labels_.grid.spacing_mm;
    return std::sqrt(h.x * h.y) / nodes_.spacing_mm[axis];
}

// Between slices this far apart no noise remains that wider smoothing would remove; it would only
// flatten curvature.
double LabelDistance::largest_sigma_nodes(int axis) const {
    const Vector3 h = labels_.grid.spacing_mm;
    return thick(axis) && h.z >= 3.5 * std::max(h.x, h.y) ? 0.3 * factor_ : 1e9;
}

void LabelDistance::add_level(double sigma_vx, double tolerance_vx) {
    Level level;
    level.tolerance_vx = tolerance_vx;
    for (int a = 0; a < 3; ++a) {
        if (nodes_.size[a] < 2) continue;
        double sigma = std::min(sigma_vx * nodes_per_vx(a), largest_sigma_nodes(a));
        if (thick(a) && options_.sigma_slices > 0) {
            sigma = options_.sigma_slices * factor_ * std::min(1.0, sigma_vx / options_.sigma_vx);
        }
        const auto u = static_cast<std::size_t>(a);
        // The moment of 1/3 compensates for the cubic B-spline that later interpolates the nodes.
        level.kernels.taps[u] = smoothing_kernel(sigma, 1.0 / 3);
        // A structure that is thin in one slice is thin half-way to the next.
        level.spread.taps[u] =
            spreading_kernel(thick(a) ? 0.5 * factor_ : std::max(0.8, 0.7 * sigma));
    }
    levels_.push_back(std::move(level));
}

VoxelBox LabelDistance::reach(const LabelSet& labels) const {
    VoxelBox box;
    for (std::size_t l = 0; l < boxes_.size(); ++l) {
        if (labels[l]) box = united(box, boxes_[l]);
    }
    if (box.empty()) return box;
    const Vector3 h = labels_.grid.spacing_mm;
    // Outside the padded box the labels cannot win; the reach of the kernel is added to keep the
    // border out of the result.
    Int3 pad;
    for (int a = 0; a < 3; ++a) {
        const int kernel = levels_.empty() ? 0 : levels_[0].kernels.reach(a);
        pad[a] = static_cast<int>(
            std::ceil(std::min(limit_mm_, 6 * h[a]) / h[a] + kernel * nodes_.spacing_mm[a] / h[a]));
    }
    if (factor_ > 1) pad.z = 2;
    box = grow(box, pad, labels_.grid.size);
    if (factor_ > 1) {
        box.size.z = (box.size.z - 1) * factor_ + 1;
        box.first.z *= factor_;
    }
    return box;
}

LabelDistance::Margins LabelDistance::margins() const {
    Margins m{};
    if (!levels_.empty()) {
        m.blended = reach_of(wide_.spread);
        m.widened = sum(m.blended, reach_of(wide_.kernels));
        // A width's values depend on those of the next finer one and on the strays around.
        Int3 finer{0, 0, 0};
        for (std::size_t l = levels_.size(); l-- > 1;) {
            finer = larger(finer, sum(reach_of(levels_[l].spread), reach_of(levels_[l].kernels)));
        }
        m.detailed = larger(m.blended, larger(reach_of(levels_[0].spread), finer));
        m.smoothed = sum(larger(m.detailed, m.widened), reach_of(levels_[0].kernels));
    }
    for (int a = 0; a < 3; ++a) {
        m.measured[a] =
            m.smoothed[a] + static_cast<int>(std::ceil(limit_mm_ / nodes_.spacing_mm[a])) + 1;
    }
    return m;
}

VoxelBox LabelDistance::distance(const LabelSet& labels,
                                 std::vector<float>* phi,
                                 Scratch* scratch) const {
    const VoxelBox box = reach(labels);
    if (box.empty()) {
        phi->clear();
    } else {
        distance_on(labels, box, nullptr, &scratch->phi, scratch);
        to_plain(scratch->phi, phi);
    }
    return box;
}

void LabelDistance::distance_on(const LabelSet& labels,
                                const VoxelBox& part,
                                const NodeBlocks* needed,
                                SparseBox* phi,
                                Scratch* scratch) const {
    if (factor_ > 1) needed = nullptr;
    const VoxelBox whole = reach(labels);
    const Margins margin = margins();
    const VoxelBox measured = grown_within(part, margin.measured, whole);
    SparseBox &raw = scratch->raw, &smooth = scratch->smooth, &wide = scratch->wide,
              &other = scratch->other;
    if (factor_ > 1) {
        assert(part.size.z == whole.size.z);
        shape_interpolated(labels, measured, &scratch->plain, scratch);
        const auto limit = static_cast<float>(limit_mm_);
        to_sparse(measured, scratch->plain, limit, -limit, &raw);
        scratch->slices_done();
    } else {
        sparse_distance(labels_, labels, measured, limit_mm_, &raw, {&smooth, &wide, &other});
    }
    if (levels_.empty()) {
        crop(raw, part, phi);
        return;
    }
    // Each step is done on the nodes that the next ones need and no others.
    const VoxelBox smoothed = grown_within(part, margin.smoothed, whole),
                   widened = grown_within(part, margin.widened, whole),
                   detailed = grown_within(part, margin.detailed, whole),
                   blended = grown_within(part, margin.blended, whole);
    const auto shrink = [&](const VoxelBox& box, SparseBox* values) {
        if (box.count() == values->box().count()) return;
        crop(*values, box, &other);
        values->swap(other);
    };
    shrink(smoothed, &raw);
    smooth_sparse(raw, levels_[0].kernels, &smooth, &other);
    const bool cut = needed == nullptr && widened.count() < smoothed.count();
    if (cut) crop(smooth, widened, phi);
    smooth_sparse(cut ? *phi : smooth, wide_.kernels, &wide, &other, needed, margin.blended);
    shrink(blended, &wide);
    shrink(detailed, &raw);
    shrink(detailed, &smooth);
    add_detail(labels, raw, 0, &smooth, scratch);
    shrink(blended, &smooth);
    const std::vector<std::size_t> strays = find_strays(labels, wide, wide_.tolerance_vx);
    if (!strays.empty()) blend(wide_.spread, strays, smooth, needed, &wide, scratch);
    shrink(part, &wide);
    phi->swap(wide);
}

}  // namespace sonocase::pipeline
