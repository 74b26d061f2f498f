// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_bundle.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/volume/tissue_mechanics.h"
#include "runtime/imaging/press/skin_plane.h"

namespace sonocase::runtime::press {

namespace {

constexpr double kTableVenousPressure_mmhg = 8;

}  // namespace

PressBundle::PressBundle(const CaseView& view, const PressBundleOptions& options)
    : bundle_(view), simd_(options.simd) {
    const CaseBundle& bundle = *view;
    assert(options.venous_pressure_mmhg > 0 && bundle.labels.size() <= kMaxPressTissues);
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    for (std::size_t n = 0; n < bundle.labels.size(); ++n) {
        const Tissue& tissue = bundle.tissues[static_cast<std::size_t>(tissue_of[n])];
        const TissueMechanics m = mechanics_of(tissue, bundle.labels[n].name);
        const double scale =
            m.drains ? options.venous_pressure_mmhg / kTableVenousPressure_mmhg : 1;
        PressTissue out;
        out.stiffness_kpa = static_cast<float>(
            std::clamp(scale * m.stiffness_kpa, kLeastStiffnessKpa, kGreatestStiffnessKpa));
        out.outside = tissue.kind == TissueKind::outside;
        out.drains = m.drains;
        out.rigid = m.rigid;
        out.membrane = tissue.name == "skin";
        tissues_.push_back(out);
    }
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    uniform_.assign(labels.uniform.begin(), labels.uniform.end());
    uniform_.resize(uniform_.size() + 1);
    bricks_ = {reinterpret_cast<const std::int32_t*>(labels.table.data()), uniform_.data(),
               reinterpret_cast<const std::int32_t*>(labels.pool.data()), labels.size,
               brick_count(labels.size)};
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
    assert(lines.size() <= kMostPressLines);
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
    look_along(self.simd_, self.bricks_, voxels, depth_mm, tissue);
}

void PressBundle::settle_skin(const void* context,
                              std::span<const PressLine> lines,
                              std::span<double> depth_mm) {
    const PressBundle& self = *static_cast<const PressBundle*>(context);
    constexpr double kWithinMm = 0.01;  // in the voxel that was found
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
    return {tissues_, {this, along, settle_skin}};
}

}  // namespace sonocase::runtime::press
