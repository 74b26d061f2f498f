// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/lesion_place.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/pathology/lesion_shape.h"
#include "pipeline/pathology/place_pathology.h"
#include "pipeline/segmentation/distance/marked_distance.h"

namespace sonocase::pipeline::inline pathology {
namespace {

constexpr int kSurfacePoints = 240;
constexpr int kMarginVx = 4;

Vector3 voxel_of(const VoxelBox& box, std::uint32_t index) {
    const auto x = static_cast<std::uint32_t>(box.size.x),
               y = static_cast<std::uint32_t>(box.size.y), j = index / x % y, k = index / x / y;
    return {static_cast<double>(box.first.x) + index % x, static_cast<double>(box.first.y) + j,
            static_cast<double>(box.first.z) + k};
}

// Distances to the surface half a voxel before the nearest voxel of these labels, mm, in a box
// sampled at every `step`-th voxel.
std::vector<float> distances_mm(
    const LabelVolume& volume, const VoxelBox& box, int step, const LabelSet& labels, double mm) {
    const Int3 size{(box.size.x + step - 1) / step, (box.size.y + step - 1) / step,
                    (box.size.z + step - 1) / step};
    std::vector<std::uint8_t> marked;
    marked.reserve(static_cast<std::size_t>(size.x) * size.y * size.z);
    for (int k = 0; k < size.z; ++k)
        for (int j = 0; j < size.y; ++j)
            for (int i = 0; i < size.x; ++i)
                marked.push_back(labels[volume.voxels[volume.grid.index(
                    box.first.x + step * i, box.first.y + step * j, box.first.z + step * k)]]);
    std::vector<float> out = distance_to_marked(marked, size);
    for (float& d : out)
        d = d > 0 ? static_cast<float>(mm) * (static_cast<float>(step) * d - 0.5f) : 0;
    return out;
}

bool clear_of(const std::vector<PlacedLesion>& earlier,
              const VoxelField& mine,
              const std::vector<Vector3>& surface,
              double apart_vx) {
    for (const PlacedLesion& other : earlier) {
        for (const Vector3 p : surface)
            if (other.distance(p) < apart_vx) return false;
        for (const Vector3 p : other.surface)
            if (mine(p) < apart_vx) return false;
        if (mine(other.centre_vx) < 0) return false;
    }
    return true;
}

}  // namespace

Clearances::Clearances(const LabelVolume& volume,
                       const LabelSet& host,
                       const LabelSet& vessels,
                       bool skin) {
    const std::vector<VoxelBox> boxes = label_boxes(volume);
    VoxelRange range{{1 << 30, 1 << 30, 1 << 30}, {-1, -1, -1}};
    for (std::size_t l = 1; l < boxes.size(); ++l) {
        if (!host[l] || boxes[l].empty()) continue;
        for (int axis = 0; axis < 3; ++axis) {
            range.low[axis] = std::min(range.low[axis], boxes[l].first[axis]);
            range.high[axis] =
                std::max(range.high[axis], boxes[l].first[axis] + boxes[l].size[axis] - 1);
        }
    }
    if (range.empty()) return;
    for (int axis = 0; axis < 3; ++axis) {  // what lies beside the host counts as well
        range.low[axis] = std::max(0, range.low[axis] - kMarginVx);
        range.high[axis] = std::min(volume.grid.size[axis] - 1, range.high[axis] + kMarginVx);
    }
    box_ = box_of(range);
    const double mm = volume.grid.spacing_mm.x;
    border_ = distances_mm(volume, box_, 1, ~(host | vessels), mm);
    vessel_ = distances_mm(volume, box_, 1, vessels, mm);
    if (!skin) return;
    // The skin lies far away: coarse samples of the whole volume are enough.
    coarse_ = std::max(1, static_cast<int>(3 / mm));
    const VoxelBox whole{{0, 0, 0}, volume.grid.size};
    skin_ = distances_mm(volume, whole, coarse_, LabelSet{}.set(0), mm);
    for (int axis = 0; axis < 3; ++axis)
        coarse_box_.size[axis] = (volume.grid.size[axis] + coarse_ - 1) / coarse_;
}

double Clearances::below_skin_mm(Vector3 voxel) const {
    return at(skin_, coarse_box_, (1.0 / coarse_) * voxel);
}

double Clearances::at(const std::vector<float>& field, const VoxelBox& box, Vector3 voxel) {
    return field.empty() ? 0 : sampled_at(box, field, voxel, 0);
}

std::vector<std::uint32_t> Clearances::deeper_than(double mm) const {
    std::vector<std::uint32_t> found;
    const auto limit = static_cast<float>(std::max(0.0, mm));
    for (std::size_t n = 0; n < border_.size(); ++n)
        if (border_[n] > 0 && border_[n] >= limit && vessel_[n] > 0)
            found.push_back(static_cast<std::uint32_t>(n));
    return found;
}

double Clearances::deepest_mm() const {
    return border_.empty() ? 0
                           : static_cast<double>(*std::max_element(border_.begin(), border_.end()));
}

std::vector<Vector3> surface_points(const RoughEllipsoid& shape,
                                    double radius_vx,
                                    double shell_vx,
                                    Vector3 centre_vx) {
    std::vector<Vector3> points = sphere_directions(kSurfacePoints);
    for (Vector3& u : points) u = centre_vx + (radius_vx * shape.radius(u) + shell_vx) * u;
    return points;
}

bool fits(const RoughEllipsoid& shape,
          double radius_mm,
          Vector3 centre_vx,
          const Clearances& clear,
          const PlaceRules& rules,
          const std::vector<PlacedLesion>& earlier) {
    if (rules.near_vx && norm(centre_vx - *rules.near_vx) * rules.voxel_mm > rules.near_mm)
        return false;
    const double radius_vx = radius_mm / rules.voxel_mm, shell_vx = rules.shell_mm / rules.voxel_mm;
    const std::vector<Vector3> surface = surface_points(shape, radius_vx, shell_vx, centre_vx);
    double shallowest = 1e9;
    const bool depth = rules.depth_low_mm > 0 || rules.depth_high_mm < 1e8;
    for (const Vector3 p : surface) {
        if (clear.to_border_mm(p) < rules.capsule_mm) return false;
        if (clear.to_vessel_mm(p) < rules.vessel_mm) return false;
        if (depth) shallowest = std::min(shallowest, clear.below_skin_mm(p));
    }
    if (depth && (shallowest < rules.depth_low_mm || shallowest > rules.depth_high_mm))
        return false;
    const VoxelField rank = shape.rank_about(centre_vx);
    const VoxelField mine = [&](Vector3 at) { return rank(at) - radius_vx - shell_vx; };
    return clear_of(earlier, mine, surface, rules.apart_mm / rules.voxel_mm);
}

std::optional<Vector3> find_place(const RoughEllipsoid& shape,
                                  double radius_mm,
                                  const Clearances& clear,
                                  const PlaceRules& rules,
                                  const std::vector<PlacedLesion>& earlier,
                                  std::uint64_t seed) {
    std::vector<std::uint32_t> centres =
        clear.deeper_than(radius_mm * shape.min_radius() + rules.shell_mm + rules.capsule_mm);
    if (rules.near_vx)
        std::erase_if(centres, [&](std::uint32_t c) {
            return norm(voxel_of(clear.box(), c) - *rules.near_vx) * rules.voxel_mm > rules.near_mm;
        });
    if (centres.empty()) return std::nullopt;
    for (int n = 0; n < kPlacementTries; ++n) {
        const auto t = static_cast<std::uint64_t>(n);
        const auto at = static_cast<std::size_t>(uniform_at(derive_seed(seed, 11), t) *
                                                 static_cast<double>(centres.size()));
        Vector3 centre = voxel_of(clear.box(), centres[at]);
        for (int axis = 0; axis < 3; ++axis)  // not tied to the voxels
            centre[axis] +=
                uniform_at(derive_seed(seed, 12 + static_cast<unsigned>(axis)), t) - 0.5;
        if (fits(shape, radius_mm, centre, clear, rules, earlier)) return centre;
    }
    return std::nullopt;
}

std::optional<Vector3> find_lowest(double radius_mm,
                                   const Clearances& clear,
                                   Vector3 down,
                                   double voxel_mm,
                                   const std::vector<PlacedLesion>& earlier) {
    const std::vector<Vector3> none;
    std::optional<Vector3> best;
    double lowest = -1e18;
    for (const std::uint32_t c : clear.deeper_than(0.9 * radius_mm)) {
        const Vector3 centre = voxel_of(clear.box(), c);
        if (dot(centre, down) <= lowest) continue;
        const VoxelField ball = [&](Vector3 at) {
            return norm(at - centre) - radius_mm / voxel_mm;
        };
        std::vector<Vector3> surface = sphere_directions(40);
        for (Vector3& u : surface) u = centre + (radius_mm / voxel_mm) * u;
        if (!clear_of(earlier, ball, surface, 0)) continue;
        best = centre;
        lowest = dot(centre, down);
    }
    return best;
}

}  // namespace sonocase::pipeline::inline pathology
