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

OutlineField outline_field(const LabelVolume& labels,
                           const SliceGroups& groups,
                           int outline,
                           int pad) {
    const Outline& o = groups.outlines[static_cast<std::size_t>(outline)];
    OutlineField field;
    field.window = grow(o.box, {pad, pad, 0}, labels.grid.size);
    LabelVolume mask;
    mask.grid = labels.grid;
    mask.grid.size = {field.window.size.x, field.window.size.y, 1};
    mask.voxels.resize(mask.grid.voxel_count());
    for (int j = 0; j < field.window.size.y; ++j) {
        for (int i = 0; i < field.window.size.x; ++i) {
            mask.voxels[mask.grid.index(i, j, 0)] =
                groups.outline_of_voxel[labels.grid.index(
                    field.window.first.x + i, field.window.first.y + j, o.slice)] == outline;
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

}  // namespace

void LabelDistance::blend_group(const SliceGroup& group,
                                bool own_label,
                                const VoxelBox& box,
                                std::vector<float>* phi) const {
    constexpr int kPad = 6;
    if (!own_label) {  // most groups are nowhere near
        Int3 low = box.first, high;
        for (int a = 0; a < 3; ++a) high[a] = box.first[a] + box.size[a];
        if ((group.slice + 1) * factor_ <= low.z || group.slice * factor_ >= high.z) return;
        bool near = false;
        for (const int o : {group.lower, group.upper}) {
            const VoxelBox& b = groups_.outlines[static_cast<std::size_t>(o)].box;
            near = near || (b.first.x < high.x && b.first.x + b.size.x > low.x &&
                            b.first.y < high.y && b.first.y + b.size.y > low.y);
        }
        if (!near) return;
    }
    const OutlineField low = outline_field(labels_, groups_, group.lower, kPad);
    const OutlineField high = outline_field(labels_, groups_, group.upper, kPad);
    for (int step = 1; step < factor_; ++step) {
        const double t = static_cast<double>(step) / factor_;
        const int k = group.slice * factor_ + step - box.first.z;
        if (k < 0 || k >= box.size.z) continue;
        // Where a pixel of this step lies in either slice: turned and shifted back or onwards.
        struct Pose {
            double c, s, from_x, from_y, to_x, to_y;  // pixel - from, turned, + to
        };
        const auto pose = [&](double x, double y, double part) {
            const double angle = part * group.turn_rad;
            return Pose{std::cos(angle),
                        std::sin(angle),
                        x - part * group.shift_x,
                        y - part * group.shift_y,
                        x,
                        y};
        };
        const auto centre = [&](int outline) -> const Outline& {
            return groups_.outlines[static_cast<std::size_t>(outline)];
        };
        const Pose to_low = pose(centre(group.lower).x, centre(group.lower).y, -t);
        const Pose to_high = pose(centre(group.upper).x, centre(group.upper).y, 1 - t);
        const auto value = [](const OutlineField& f, const Pose& p, int x, int y) {
            const double u = x - p.from_x, v = y - p.from_y;
            return f.at(p.to_x + p.c * u - p.s * v, p.to_y + p.s * u + p.c * v);
        };
        int x0 = 1 << 30, y0 = x0, x1 = -x0, y1 = -x0;
        const auto include = [&](const OutlineField& f, const Pose& p) {
            for (int corner = 0; corner < 4; ++corner) {
                const double u = f.window.first.x + (corner & 1 ? f.window.size.x : 0) - p.to_x;
                const double v = f.window.first.y + (corner & 2 ? f.window.size.y : 0) - p.to_y;
                const double x = p.from_x + p.c * u + p.s * v, y = p.from_y - p.s * u + p.c * v;
                x0 = std::min(x0, static_cast<int>(std::floor(x)));
                y0 = std::min(y0, static_cast<int>(std::floor(y)));
                x1 = std::max(x1, static_cast<int>(std::ceil(x)));
                y1 = std::max(y1, static_cast<int>(std::ceil(y)));
            }
        };
        include(low, to_low);
        include(high, to_high);
        x0 = std::max(x0, box.first.x);
        y0 = std::max(y0, box.first.y);
        x1 = std::min(x1, box.first.x + box.size.x);
        y1 = std::min(y1, box.first.y + box.size.y);
        const float w = static_cast<float>(t);
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                const float a = value(low, to_low, x, y), b = value(high, to_high, x, y);
                const float here = a + w * (b - a);
                float& to = (*phi)[box.index(x - box.first.x, y - box.first.y, k)];
                to = own_label ? std::min(to, here) : std::max(to, -here);
            }
        }
    }
}

// The distance in space to a surface is shorter than that within a slice which it crosses
// obliquely: by the cosine of its lean, which the slices on either side tell. They tell it by their
// distances in space, so that it is found in two rounds.
void LabelDistance::lean(const VoxelBox& slices, Scratch* work) const {
    if (slices.size.z < 2) return;
    constexpr int kRounds = 2;
    constexpr float kLeast = 0.2f;  // of the cosine; slices say no more
    const std::size_t plane =
        static_cast<std::size_t>(slices.size.x) * static_cast<std::size_t>(slices.size.y);
    const float h = static_cast<float>(labels_.grid.spacing_mm.z);
    std::vector<float>&flat = work->flat, &within = work->within;
    const std::vector<std::uint8_t>& capped = work->capped;
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

// An outline that ends: in it and in the next two slices, the distance to a ball through its rim
// and the pole. Slices that hold nothing of it would say nothing of how far beyond they are.
void LabelDistance::cap(const SliceGroup& group,
                        bool own,
                        const VoxelBox& slices,
                        std::vector<float>* flat,
                        std::vector<std::uint8_t>* capped) const {
    const bool ends = group.lower >= 0;
    const Outline& outline =
        groups_.outlines[static_cast<std::size_t>(ends ? group.lower : group.upper)];
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
        outline_field(labels_, groups_, ends ? group.lower : group.upper, pad);
    const double height = group.end * h;
    const double ball = 0.5 * (field.deepest * field.deepest / height + height);
    for (int beyond = 0; beyond <= 2; ++beyond) {
        const int k = outline.slice + (ends ? beyond : -beyond) - slices.first.z;
        if (k < 0 || k >= slices.size.z) continue;
        const double rise = beyond * h - height + ball;
        for (int y = 0; y < field.window.size.y; ++y) {
            for (int x = 0; x < field.window.size.x; ++x) {
                const int i = field.window.first.x + x - slices.first.x,
                          j = field.window.first.y + y - slices.first.y;
                if (i < 0 || j < 0 || i >= slices.size.x || j >= slices.size.y) continue;
                const float within = field.phi[field.window.index(x, y, 0)];
                const double across = std::max(0.0f, within + field.deepest);
                const float value = static_cast<float>(std::hypot(across, rise) - ball);
                const std::size_t v = slices.index(i, j, k);
                const float side = own ? 1.0f : -1.0f;
                float& to = (*flat)[v];
                // In it only where its rim is the surface: within a union it may be none.
                const bool inside = beyond == 0 && within < 0 && side * to > within - 0.5 * pixel;
                if (side * to <= value && !inside) continue;
                to = side * value;
                (*capped)[v] = 1;
            }
        }
    }
}

void LabelDistance::shape_interpolated(const LabelSet& labels,
                                       const VoxelBox& box,
                                       std::vector<float>* phi,
                                       Scratch* work) const {
    // `box` is whole slices: its nodes run from slice `first` to slice `first + slices - 1`.
    const int first = box.first.z / factor_;
    const int slices = (box.size.z - 1) / factor_ + 1;
    const VoxelBox in_slices{{box.first.x, box.first.y, first}, {box.size.x, box.size.y, slices}};
    std::vector<float>& flat = work->flat;
    signed_distance(labels_, labels, in_slices, limit_mm_, {true, true, false}, &flat);
    work->capped.assign(flat.size(), 0);
    for (const bool own : {false, true}) {
        for (std::size_t l = 0; l < groups_.of_label.size(); ++l) {
            if (labels[l] != own) continue;
            for (const SliceGroup& group : groups_.of_label[l]) {
                if (group.lower < 0 || group.upper < 0)
                    cap(group, own, in_slices, &flat, &work->capped);
            }
        }
    }
    lean(in_slices, work);
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
    // What another label's outline sweeps is its own and not this label's; then this label's own.
    if (!options_.follow_shift) return;
    for (const bool own : {false, true}) {
        for (std::size_t l = 0; l < groups_.of_label.size(); ++l) {
            if (labels[l] != own) continue;
            for (const SliceGroup& group : groups_.of_label[l]) {
                if (group.lower >= 0 && group.upper >= 0) blend_group(group, own, box, phi);
            }
        }
    }
}

}  // namespace sonocase::pipeline