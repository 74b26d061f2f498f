// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_bundle.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "formats/volume/tissue_mechanics.h"

namespace sonocase::runtime::press {

static_assert(kBrickEdge == 4);  // along() splits coordinates by their bits

namespace {

constexpr double kTableVenousPressure_mmhg = 8;

// The nearest voxel on one axis; what is not a number counts as the first.
int nearest(double v, int size) {
    return v > 0 ? static_cast<int>(std::min(v + 0.5, size - 0.5)) : 0;
}

}  // namespace

PressBundle::PressBundle(const CaseBundle& bundle, const PressBundleOptions& options)
    : bundle_(&bundle), bricks_(brick_count(bundle.label_bricks.size)) {
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
}

std::uint8_t PressBundle::voxel(double x, double y, double z) const {
    const BrickVolume<std::uint8_t>& labels = bundle_->label_bricks;
    const int i = nearest(x, labels.size.x), j = nearest(y, labels.size.y),
              k = nearest(z, labels.size.z);
    const auto brick = static_cast<std::size_t>(
        (k / kBrickEdge * bricks_.y + j / kBrickEdge) * bricks_.x + i / kBrickEdge);
    const std::uint32_t entry = labels.table[brick];
    if (entry & kUniformBrick) return labels.uniform[entry & ~kUniformBrick];
    const int within =
        i % kBrickEdge + kBrickEdge * (j % kBrickEdge + kBrickEdge * (k % kBrickEdge));
    return labels
        .pool[static_cast<std::size_t>(entry) * kBrickVoxels + static_cast<std::size_t>(within)];
}

std::uint8_t PressBundle::label(Point3 mannequin) const {
    const Point3 v = bundle_->grid.voxel_from_point(mannequin);
    return voxel(v.x, v.y, v.z);
}

void PressBundle::along(const void* context,
                        Point3 from,
                        Vector3 direction,
                        std::span<const float> depth_mm,
                        std::uint8_t* tissue) {
    const PressBundle& self = *static_cast<const PressBundle*>(context);
    const BrickVolume<std::uint8_t>& labels = self.bundle_->label_bricks;
    // Grids of bundles are cubic and not turned: one multiplication per axis from mm to voxels.
    const double per_mm = 1 / self.bundle_->grid.spacing_mm.x;
    const Point3 start = self.bundle_->grid.voxel_from_point(self.mannequin_from_probe_ * from);
    const Vector3 step = per_mm * (self.mannequin_from_probe_ * direction);
    std::array<std::array<float, 2>, 3> line{};
    std::array<float, 3> last{};
    for (int axis = 0; axis < 3; ++axis) {
        const auto at = static_cast<std::size_t>(axis);
        line[at] = {static_cast<float>(start[axis]), static_cast<float>(step[axis])};
        last[at] = static_cast<float>(labels.size[axis] - 1);
    }
    // First all addresses, several at a time; then the voxels, one after another.
    constexpr std::size_t kRun = 64;
    std::array<std::int32_t, kRun> brick{}, within{};
    for (std::size_t begin = 0; begin < depth_mm.size(); begin += kRun) {
        const std::size_t count = std::min(kRun, depth_mm.size() - begin);
        const float* depth = depth_mm.data() + begin;
        for (std::size_t n = 0; n < count; ++n) {
            const auto on_axis = [&](std::size_t axis) {
                const float v = line[axis][0] + depth[n] * line[axis][1];
                const float low = v > 0 ? v : 0;
                return static_cast<std::int32_t>((low < last[axis] ? low : last[axis]) + 0.5f);
            };
            const std::int32_t i = on_axis(0), j = on_axis(1), k = on_axis(2);
            brick[n] = ((k >> 2) * self.bricks_.y + (j >> 2)) * self.bricks_.x + (i >> 2);
            within[n] = (i & 3) + 4 * (j & 3) + 16 * (k & 3);
        }
        for (std::size_t n = 0; n < count; ++n) {
            const std::uint32_t entry = labels.table[static_cast<std::size_t>(brick[n])];
            tissue[begin + n] = entry & kUniformBrick
                                    ? labels.uniform[entry & ~kUniformBrick]
                                    : labels.pool[static_cast<std::size_t>(entry) * kBrickVoxels +
                                                  static_cast<std::size_t>(within[n])];
        }
    }
}

PressScene PressBundle::scene(const Rigid& mannequin_from_probe) {
    mannequin_from_probe_ = mannequin_from_probe;
    return {tissues_, {this, along}};
}

}  // namespace sonocase::runtime::press
