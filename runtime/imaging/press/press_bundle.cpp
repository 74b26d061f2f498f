// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_bundle.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/volume/boundary_record.h"
#include "formats/volume/tissue.h"

namespace sonocase::runtime::press {

std::optional<SkinPlane> skin_plane_of(const CaseView& bundle, Int3 v) {
    if (bundle->boundary.table.empty()) return std::nullopt;
    if (bundle.blocks() != nullptr) bundle.blocks()->ensure_voxel_loaded(v.x, v.y, v.z);
    const std::uint32_t bits = bundle->boundary.at(v.x, v.y, v.z);
    if (bits == kNoBoundary) return std::nullopt;
    const bool body = bundle->label_bricks.at(v.x, v.y, v.z) != 0;
    const BoundaryRecord r = unpack_boundary(bits);
    if (body == (r.second_label != 0)) return std::nullopt;
    const double sign = body ? 1 : -1;
    return SkinPlane{{static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)},
                     sign * r.distance_vx,
                     sign * r.normal};
}

double steps_to_skin(const CaseView& bundle, Point3 p, Vector3 step) {
    constexpr double kMinSlope = 0.2;
    const double length = norm(step), limit = std::sqrt(3.0) / length;
    // The voxel's own record may be that of the lower face of a thin skin.
    for (const Point3 q : {p, p - step}) {
        const Int3 v{static_cast<int>(std::floor(q.x + 0.5)),
                     static_cast<int>(std::floor(q.y + 0.5)),
                     static_cast<int>(std::floor(q.z + 0.5))};
        if (!bundle->grid.contains(v.x, v.y, v.z)) continue;
        const std::optional<SkinPlane> skin = skin_plane_of(bundle, v);
        if (!skin) continue;
        const double rate = dot(skin->inward, step);
        if (rate > kMinSlope * length) return std::clamp(-skin->inside(p) / rate, -limit, limit);
    }
    return 0;
}

namespace {

using Counts = std::vector<std::vector<std::int64_t>>;  // [draining label][label beside it]

// Counts the neighbours inside every `every`-th brick of the pool.
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
    // Padded to every value of a byte, so that a damaged voxel finds an entry.
    std::vector<bool> drains(256, false), soft(256, false);
    std::vector<std::int32_t> out(256);
    for (std::size_t l = 0; l < out.size(); ++l) out[l] = static_cast<std::int32_t>(l);
    bool any = false;
    for (std::size_t l = 0; l < count && l < drains.size(); ++l) {
        if (tissue_of[l] < 0) continue;
        const Tissue& tissue = bundle.tissues[tissue_of[l]];
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
            std::int64_t largest = 0;
            for (std::size_t beside = 0; beside < count; ++beside) {
                if (!soft[beside] || counts[l][beside] <= largest) continue;
                largest = counts[l][beside];
                out[l] = static_cast<std::int32_t>(beside);
            }
            complete = complete && largest > 0;
        }
        if (complete) break;
    }
    return out;
}

namespace {

constexpr double kTableVenousPressureMmhg = 8;

}  // namespace

PressBundle::PressBundle(const CaseView& view, const PressBundleOptions& options)
    : bundle_(view), simd_(options.simd) {
    const CaseBundle& bundle = *view;
    assert(options.venous_pressure_mmhg > 0 && bundle.labels.size() <= kMaxPressTissues);
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    for (std::size_t n = 0; n < bundle.labels.size(); ++n) {
        const Tissue& tissue = bundle.tissues[tissue_of[n]];
        const TissueMechanics m = mechanics_of(tissue, bundle.labels[n].name);
        PressTissue out;
        table_kpa_.push_back(m.stiffness_kpa);
        out.outside = tissue.kind == TissueKind::outside;
        out.drains = m.drains;
        out.rigid = m.rigid;
        out.membrane = tissue.name == "skin";
        tissues_.push_back(out);
    }
    set_venous_pressure(options.venous_pressure_mmhg);
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    uniform_.assign(labels.uniform.begin(), labels.uniform.end());
    uniform_.resize(uniform_.size() + 1);
    bricks_ = {reinterpret_cast<const std::int32_t*>(labels.table.data()), uniform_.data(),
               reinterpret_cast<const std::int32_t*>(labels.pool.data()), labels.size,
               brick_count(labels.size)};
}

void PressBundle::set_venous_pressure(double mmhg) {
    for (std::size_t n = 0; n < tissues_.size(); ++n) {
        const double scale = tissues_[n].drains ? mmhg / kTableVenousPressureMmhg : 1;
        tissues_[n].stiffness_kpa = static_cast<float>(
            std::clamp(scale * table_kpa_[n], kMinStiffnessKpa, kMaxStiffnessKpa));
    }
}

std::uint8_t PressBundle::label(Point3 mannequin) const {
    const Point3 v = bundle_->grid.voxel_from_point(mannequin);
    const Int3 size = bundle_->label_bricks.size;
    const auto nearest = [](double x, int count) {  // what is not a number counts as the first
        return x > 0 ? static_cast<int>(std::min(x + 0.5, count - 0.5)) : 0;
    };
    return bundle_->label_bricks.at(nearest(v.x, size.x), nearest(v.y, size.y),
                                    nearest(v.z, size.z));
}

void PressBundle::along(const void* context,
                        std::span<const PressLine> lines,
                        std::span<const float> depth_mm,
                        std::uint8_t* tissue) {
    const PressBundle& self = *static_cast<const PressBundle*>(context);
    assert(lines.size() <= kMaxPressLines);
    // Grids of bundles are cubic and not turned: one multiplication per axis from mm to voxels.
    const double per_mm = 1 / self.bundle_->grid.spacing_mm.x;
    VoxelLines voxels;
    voxels.count = static_cast<int>(lines.size());
    for (std::size_t n = 0; n < lines.size(); ++n) {
        const Point3 start =
            self.bundle_->grid.voxel_from_point(self.mannequin_from_probe_ * lines[n].from);
        const Vector3 step = per_mm * (self.mannequin_from_probe_ * lines[n].direction);
        for (int axis = 0; axis < 3; ++axis) {
            voxels.start[axis][n] = static_cast<float>(start[axis]);
            voxels.step[axis][n] = static_cast<float>(step[axis]);
        }
    }
    labels_along(self.simd_, self.bricks_, voxels, depth_mm, tissue);
}

void PressBundle::refine_skin(const void* context,
                              std::span<const PressLine> lines,
                              std::span<double> depth_mm) {
    const PressBundle& self = *static_cast<const PressBundle*>(context);
    constexpr double kWithinMm = 0.01;  // a place this far in lies in the voxel that was found
    constexpr double kStepMm = 0.5;
    const double per_mm = 1 / self.bundle_->grid.spacing_mm.x;
    for (std::size_t n = 0; n < lines.size(); ++n) {
        if (std::isnan(depth_mm[n])) continue;
        const Point3 in = lines[n].from + (depth_mm[n] + kWithinMm) * lines[n].direction;
        const Point3 p = self.bundle_->grid.voxel_from_point(self.mannequin_from_probe_ * in);
        const Vector3 step = (kStepMm * per_mm) * (self.mannequin_from_probe_ * lines[n].direction);
        const double steps = steps_to_skin(self.bundle_, p, step);
        if (steps != 0) depth_mm[n] += kWithinMm + steps * kStepMm;
    }
}

PressScene PressBundle::scene(const Rigid& mannequin_from_probe) {
    mannequin_from_probe_ = mannequin_from_probe;
    return {tissues_, {this, along, refine_skin}};
}

}  // namespace sonocase::runtime::press
