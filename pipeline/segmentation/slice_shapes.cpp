// The part of label_distance.h that interpolates thick slices by shape.
#include <algorithm>
#include <cmath>

#include "pipeline/segmentation/label_distance.h"

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
    signed_distance(mask, 1, {{0, 0, 0}, mask.grid.size}, pad * labels.grid.spacing_mm.x,
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
            if (o < 0) continue;
            const VoxelBox& b = groups_.outlines[static_cast<std::size_t>(o)].box;
            near = near || (b.first.x < high.x && b.first.x + b.size.x > low.x &&
                            b.first.y < high.y && b.first.y + b.size.y > low.y);
        }
        if (!near) return;
    }
    const OutlineField low =
        group.lower >= 0 ? outline_field(labels_, groups_, group.lower, kPad) : OutlineField{};
    const OutlineField high =
        group.upper >= 0 ? outline_field(labels_, groups_, group.upper, kPad) : OutlineField{};
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
            return groups_.outlines[static_cast<std::size_t>(std::max(outline, 0))];
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
        if (group.lower >= 0) include(low, to_low);
        if (group.upper >= 0) include(high, to_high);
        x0 = std::max(x0, box.first.x);
        y0 = std::max(y0, box.first.y);
        x1 = std::min(x1, box.first.x + box.size.x);
        y1 = std::min(y1, box.first.y + box.size.y);
        const float w = static_cast<float>(t);
        // Share of its depth by which an outline that ends has shrunk here; past the pole it goes
        // on.
        const double beyond = (group.lower >= 0 ? t : 1 - t) / group.end;
        const float shrink =
            static_cast<float>(beyond < 1 ? 1 - std::sqrt(1 - beyond) : 0.5 + 0.5 * beyond);
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                float here = 0;
                if (group.lower >= 0 && group.upper >= 0) {
                    const float a = value(low, to_low, x, y), b = value(high, to_high, x, y);
                    here = a + w * (b - a);
                } else {
                    const bool ends = group.lower >= 0;
                    const OutlineField& own = ends ? low : high;
                    here = value(own, ends ? to_low : to_high, x, y) + own.deepest * shrink;
                }
                float& to = (*phi)[box.index(x - box.first.x, y - box.first.y, k)];
                to = own_label ? std::min(to, here) : std::max(to, -here);
            }
        }
    }
}

void LabelDistance::shape_interpolated(const LabelSet& labels,
                                       const VoxelBox& box,
                                       std::vector<float>* phi) const {
    // `box` is whole slices: its nodes run from slice `first` to slice `first + slices - 1`.
    const int first = box.first.z / factor_;
    const int slices = (box.size.z - 1) / factor_ + 1;
    const VoxelBox in_slices{{box.first.x, box.first.y, first}, {box.size.x, box.size.y, slices}};
    std::vector<float> flat;
    signed_distance(labels_, labels, in_slices, limit_mm_, {true, true, false}, &flat);
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
    for (const bool own : {false, true}) {
        for (std::size_t l = 0; l < groups_.of_label.size(); ++l) {
            if (labels[l] != own) continue;
            for (const SliceGroup& group : groups_.of_label[l]) {
                const bool moves = group.lower >= 0 && group.upper >= 0;
                if (moves && !options_.follow_shift) continue;
                blend_group(group, own, box, phi);
            }
        }
    }
}

}  // namespace sonocase::pipeline
