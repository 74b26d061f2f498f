// SPDX-License-Identifier: Apache-2.0

// The part of label_distance.h that interpolates thick slices by shape.
#include <algorithm>
#include <cmath>

#include "pipeline/segmentation/distance/label_distance.h"

namespace sonocase::pipeline {
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
    const Outline& o = map.outlines[static_cast<std::size_t>(outline)];
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
        const VoxelBox& b = groups_.outlines.outlines[static_cast<std::size_t>(o)].box;
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
    if (!own && !touches(group, box)) return;  // as for most groups
    const OutlineField low = outline_field(labels_, groups_.outlines, group.lower, kPad);
    const OutlineField high = outline_field(labels_, groups_.outlines, group.upper, kPad);
    const auto outline = [&](int o) -> const Outline& {
        return groups_.outlines.outlines[static_cast<std::size_t>(o)];
    };
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
    constexpr float kLeast = 0.2f;  // cosine; slices do not resolve smaller ones
    const std::size_t plane =
        static_cast<std::size_t>(slices.size.x) * static_cast<std::size_t>(slices.size.y);
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
                    std::abs(phi) < 1e-6f ? 1 : std::clamp(here[i] / phi, kLeast, 1.0f);
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
    const Outline& outline =
        groups_.outlines.outlines[static_cast<std::size_t>(ends ? group.lower : group.upper)];
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
    const std::size_t plane =
        static_cast<std::size_t>(box.size.x) * static_cast<std::size_t>(box.size.y);
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

}  // namespace sonocase::pipeline
