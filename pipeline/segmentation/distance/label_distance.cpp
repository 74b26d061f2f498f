// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/label_distance.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

namespace sonocase::pipeline::inline segmentation_distance {

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

// Widths: where one is too wide, finer ones are blended in.

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

// Thick slices, interpolated by shape.

namespace {

// Distance field of one outline alone, on a window of its slice.
struct OutlineField {
    VoxelBox window;
    std::vector<float> phi;
    float deepest = 0;  // mm, > 0

    float at(double x, double y) const {  // pixels of the slice; clamped to the window
        const double u = std::clamp(x - window.first.x, 0.0, window.size.x - 1.0);
        const double v = std::clamp(y - window.first.y, 0.0, window.size.y - 1.0);
        const int i = std::min(static_cast<int>(u), std::max(0, window.size.x - 2));
        const int j = std::min(static_cast<int>(v), std::max(0, window.size.y - 2));
        const float s = static_cast<float>(u - i), t = static_cast<float>(v - j);
        const int i1 = std::min(i + 1, window.size.x - 1), j1 = std::min(j + 1, window.size.y - 1);
        const float a = phi[window.index(i, j, 0)], b = phi[window.index(i1, j, 0)];
        const float c = phi[window.index(i, j1, 0)], d = phi[window.index(i1, j1, 0)];
        const float low = a + s * (b - a), high = c + s * (d - c);
        return low + t * (high - low);
    }
};

OutlineField outline_field(const LabelVolume& labels, const OutlineMap& map, int outline, int pad) {
    const Outline& o = map.outlines[outline];
    OutlineField field;
    field.window = grow(o.box, {pad, pad, 0}, labels.grid.size);
    LabelVolume mask;
    mask.grid = labels.grid;
    mask.grid.size = {field.window.size.x, field.window.size.y, 1};
    mask.voxels.resize(mask.grid.voxel_count());
    for (int j = 0; j < field.window.size.y; ++j) {
        for (int i = 0; i < field.window.size.x; ++i) {
            mask.voxels[mask.grid.index(i, j, 0)] =
                map.of_voxel[labels.grid.index(field.window.first.x + i, field.window.first.y + j,
                                               o.slice)] == outline;
        }
    }
    const int depth = std::min(o.box.size.x, o.box.size.y) / 2 + 1;
    signed_distance(
        mask, 1, {{0, 0, 0}, mask.grid.size},
        std::max(pad, depth) * std::max(labels.grid.spacing_mm.x, labels.grid.spacing_mm.y),
        {true, true, false}, &field.phi);
    for (const float p : field.phi) field.deepest = std::max(field.deepest, -p);
    return field;
}

// Maps pixels of an intermediate slice to pixels of a slice: a rotation about a centroid.
struct Pose {
    double c, s, from_x, from_y, to_x, to_y;  // pixel - from, rotated, + to

    // The pose of `outline`, moved by `part` of the group's shift and turn.
    Pose(const Outline& outline, const SliceGroup& group, double part)
        : c(std::cos(part * group.turn_rad)),
          s(std::sin(part * group.turn_rad)),
          from_x(outline.x - part * group.shift_x),
          from_y(outline.y - part * group.shift_y),
          to_x(outline.x),
          to_y(outline.y) {}
};

float value(const OutlineField& f, const Pose& p, int x, int y) {
    const double u = x - p.from_x, v = y - p.from_y;
    return f.at(p.to_x + p.c * u - p.s * v, p.to_y + p.s * u + p.c * v);
}

// Pixels x0 <= x < x1, y0 <= y < y1.
struct PixelRange {
    int x0 = 1 << 30, y0 = x0, x1 = -x0, y1 = -x0;

    // Pixels of the intermediate slice that map into the window of a field.
    void include(const OutlineField& f, const Pose& p) {
        for (int corner = 0; corner < 4; ++corner) {
            const double u = f.window.first.x + (corner & 1 ? f.window.size.x : 0) - p.to_x;
            const double v = f.window.first.y + (corner & 2 ? f.window.size.y : 0) - p.to_y;
            const double x = p.from_x + p.c * u + p.s * v, y = p.from_y - p.s * u + p.c * v;
            x0 = std::min(x0, static_cast<int>(std::floor(x)));
            y0 = std::min(y0, static_cast<int>(std::floor(y)));
            x1 = std::max(x1, static_cast<int>(std::ceil(x)));
            y1 = std::max(y1, static_cast<int>(std::ceil(y)));
        }
    }
    void cut_to(const VoxelBox& box) {
        x0 = std::max(x0, box.first.x);
        y0 = std::max(y0, box.first.y);
        x1 = std::min(x1, box.first.x + box.size.x);
        y1 = std::min(y1, box.first.y + box.size.y);
    }
};

}  // namespace

// Whether one of a pair's outlines overlaps a box of nodes.
bool LabelDistance::touches(const SliceGroup& group, const VoxelBox& box) const {
    Int3 low = box.first, high;
    for (int a = 0; a < 3; ++a) high[a] = box.first[a] + box.size[a];
    if ((group.slice + 1) * factor_ <= low.z || group.slice * factor_ >= high.z) return false;
    bool near = false;
    for (const int o : {group.lower, group.upper}) {
        const VoxelBox& b = groups_.outlines.outlines[o].box;
        near = near || (b.first.x < high.x && b.first.x + b.size.x > low.x && b.first.y < high.y &&
                        b.first.y + b.size.y > low.y);
    }
    return near;
}

// Blends the distances of a pair of outlines along their shift and turn.
void LabelDistance::blend_group(const SliceGroup& group,
                                bool own,
                                const VoxelBox& box,
                                std::vector<float>* phi) const {
    constexpr int kPad = 6;
    if (!own && !touches(group, box)) return;  // most groups
    const OutlineField low = outline_field(labels_, groups_.outlines, group.lower, kPad);
    const OutlineField high = outline_field(labels_, groups_.outlines, group.upper, kPad);
    const auto outline = [&](int o) -> const Outline& { return groups_.outlines.outlines[o]; };
    for (int step = 1; step < factor_; ++step) {
        const double t = static_cast<double>(step) / factor_;
        const int k = group.slice * factor_ + step - box.first.z;
        if (k < 0 || k >= box.size.z) continue;
        const Pose to_low(outline(group.lower), group, -t);
        const Pose to_high(outline(group.upper), group, 1 - t);
        PixelRange range;
        range.include(low, to_low);
        range.include(high, to_high);
        range.cut_to(box);
        const float w = static_cast<float>(t);
        for (int y = range.y0; y < range.y1; ++y) {
            for (int x = range.x0; x < range.x1; ++x) {
                const float a = value(low, to_low, x, y), b = value(high, to_high, x, y);
                const float here = a + w * (b - a);
                float& to = (*phi)[box.index(x - box.first.x, y - box.first.y, k)];
                to = own ? std::min(to, here) : std::max(to, -here);
            }
        }
    }
}

// The distance in space to a surface that crosses the slices obliquely is shorter than the distance
// within a slice, by the cosine of its obliquity, which follows from the slices on either side.
// They give it in terms of their distances in space, and therefore two rounds are needed.
void LabelDistance::correct_obliquity(const VoxelBox& slices, Scratch* scratch) const {
    if (slices.size.z < 2) return;
    constexpr int kRounds = 2;
    constexpr float kMin = 0.2f;  // cosine; slices do not resolve smaller ones
    const std::size_t plane = static_cast<std::size_t>(slices.size.x) * slices.size.y;
    const float h = static_cast<float>(labels_.grid.spacing_mm.z);
    std::vector<float>&flat = scratch->flat, &within = scratch->within;
    const std::vector<std::uint8_t>& capped = scratch->capped;
    within = flat;
    std::vector<float> below(plane), here(plane);
    for (int round = 0; round < kRounds; ++round) {
        for (int k = 0; k < slices.size.z; ++k) {
            const std::size_t at = static_cast<std::size_t>(k) * plane;
            float* to = flat.data() + at;
            const bool first = k == 0, last = k + 1 == slices.size.z;
            std::copy(to, to + plane, here.begin());
            const float* down = first ? here.data() : below.data();
            const float* up = last ? here.data() : to + plane;
            const float per = 1 / (h * static_cast<float>(2 - first - last));
            for (std::size_t i = 0; i < plane; ++i) {
                if (capped[at + i]) continue;
                const float phi = within[at + i];
                const float cosine =
                    std::abs(phi) < 1e-6f ? 1 : std::clamp(here[i] / phi, kMin, 1.0f);
                const float slope = per * (up[i] - down[i]) / cosine;
                to[i] = phi / std::sqrt(1 + slope * slope);
            }
            below.swap(here);
        }
    }
}

// Closes an outline that ends: in its slice and the next two, the distance becomes that to a ball
// through its rim and its pole. Slices without a part of the label hold no distance to it.
void LabelDistance::close_end(const SliceGroup& group,
                              bool own,
                              const VoxelBox& slices,
                              std::vector<float>* flat,
                              std::vector<std::uint8_t>* capped) const {
    const bool ends = group.lower >= 0;  // else it begins
    const Outline& outline = groups_.outlines.outlines[ends ? group.lower : group.upper];
    const double h = labels_.grid.spacing_mm.z;
    const double pixel = std::min(labels_.grid.spacing_mm.x, labels_.grid.spacing_mm.y);
    const int pad = std::clamp(std::min(outline.box.size.x, outline.box.size.y), 6,
                               std::max(6, static_cast<int>(limit_mm_ / pixel)));
    for (int a = 0; a < 2; ++a) {
        const int low = outline.box.first[a] - pad - slices.first[a];
        if (low >= slices.size[a] || low + outline.box.size[a] + 2 * pad <= 0) return;
    }
    if (outline.slice + 2 < slices.first.z || outline.slice - 2 >= slices.first.z + slices.size.z)
        return;
    const OutlineField field =
        outline_field(labels_, groups_.outlines, ends ? group.lower : group.upper, pad);
    const double height = group.end * h;
    const double radius = 0.5 * (field.deepest * field.deepest / height + height);
    for (int beyond = 0; beyond <= 2; ++beyond) {
        const int k = outline.slice + (ends ? beyond : -beyond) - slices.first.z;
        if (k < 0 || k >= slices.size.z) continue;
        const double rise = beyond * h - height + radius;
        for (int y = 0; y < field.window.size.y; ++y) {
            for (int x = 0; x < field.window.size.x; ++x) {
                const int i = field.window.first.x + x - slices.first.x,
                          j = field.window.first.y + y - slices.first.y;
                if (i < 0 || j < 0 || i >= slices.size.x || j >= slices.size.y) continue;
                const float within = field.phi[field.window.index(x, y, 0)];
                const double across = std::max(0.0f, within + field.deepest);
                const float value = static_cast<float>(std::hypot(across, rise) - radius);
                const std::size_t v = slices.index(i, j, k);
                const float side = own ? 1.0f : -1.0f;
                float& to = (*flat)[v];
                // In its own slice only where its rim is a surface of the union.
                const bool inside = beyond == 0 && within < 0 && side * to > within - 0.5 * pixel;
                if (side * to <= value && !inside) continue;
                to = side * value;
                (*capped)[v] = 1;
            }
        }
    }
}

// Blends the slices' distances along their axis by Catmull-Rom cubics.
void LabelDistance::blend_slices(const VoxelBox& box,
                                 const std::vector<float>& flat,
                                 std::vector<float>* phi) const {
    const int slices = (box.size.z - 1) / factor_ + 1;
    phi->resize(box.count());
    const std::size_t plane = static_cast<std::size_t>(box.size.x) * box.size.y;
    for (int k = 0; k < box.size.z; ++k) {
        const int s = std::min(k / factor_, std::max(0, slices - 2));
        const float t = static_cast<float>(k - s * factor_) / static_cast<float>(factor_);
        const auto slice = [&](int i) {
            return flat.data() + static_cast<std::size_t>(std::clamp(i, 0, slices - 1)) * plane;
        };
        const float *a = slice(s - 1), *b = slice(s), *c = slice(s + 1), *d = slice(s + 2);
        const float wa = 0.5f * t * (-1 + t * (2 - t)), wb = 0.5f * (2 + t * t * (-5 + 3 * t));
        const float wc = 0.5f * t * (1 + t * (4 - 3 * t)), wd = 0.5f * t * t * (t - 1);
        float* to = phi->data() + static_cast<std::size_t>(k) * plane;
        for (std::size_t i = 0; i < plane; ++i)
            to[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i];
    }
}

void LabelDistance::shape_interpolated(const LabelSet& labels,
                                       const VoxelBox& box,
                                       std::vector<float>* phi,
                                       Scratch* scratch) const {
    // `box` starts and ends at slices: `first` and `first + slices - 1`.
    const int first = box.first.z / factor_;
    const int slices = (box.size.z - 1) / factor_ + 1;
    const VoxelBox in_slices{{box.first.x, box.first.y, first}, {box.size.x, box.size.y, slices}};
    std::vector<float>& flat = scratch->flat;
    signed_distance(labels_, labels, in_slices, limit_mm_, {true, true, false}, &flat,
                    {&scratch->first, &scratch->second});
    scratch->capped.assign(flat.size(), 0);
    // Groups of other labels first, which are cut out of the union; then those of its own labels.
    const auto each_group = [&](const auto& body) {
        for (const bool own : {false, true}) {
            for (std::size_t l = 0; l < groups_.of_label.size(); ++l) {
                if (labels[l] != own) continue;
                for (const SliceGroup& group : groups_.of_label[l])
                    body(group, own, group.lower >= 0 && group.upper >= 0);
            }
        }
    };
    each_group([&](const SliceGroup& group, bool own, bool pair) {
        if (!pair) close_end(group, own, in_slices, &flat, &scratch->capped);
    });
    correct_obliquity(in_slices, scratch);
    blend_slices(box, flat, phi);
    if (!options_.follow_shift) return;
    each_group([&](const SliceGroup& group, bool own, bool pair) {
        if (pair) blend_group(group, own, box, phi);
    });
}

}  // namespace sonocase::pipeline::inline segmentation_distance
