// SPDX-License-Identifier: Apache-2.0

// Shapes of lesions: rounded ones and their mass effect on the tissue around them, and shapes that
// follow the anatomy (pools of fluid, swelling, tubes). Each shape is a rank that rises from what
// is filled first (place_pathology.h), or a signed distance.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "formats/base/geometry.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline pathology {

// A rounded lesion: its radius by direction, of unit volume 4 pi / 3 apart from its roughness:
//
//     R(u) = 1 / sqrt(sum_i (u . a_i)^2 / r_i^2) * max(0.3, 1 + sum_k c_k P_l(k)(u . g_k))
//
// a_i random orthonormal axes, r_i log-uniform in 1/elongation .. elongation with product 1;
// P_l Legendre polynomials of degree 2 to 5 about random axes g_k, which span the same space as the
// real spherical harmonics of those degrees; their sum has the rms `roughness`.
class RoughEllipsoid {
  public:
    RoughEllipsoid(double elongation, double roughness, double aspect, std::uint64_t seed);

    double radius(Vector3 unit) const;
    double max_radius() const { return max_radius_; }
    double min_radius() const { return min_radius_; }
    // |x - centre| / radius: rises outwards, in voxels.
    VoxelField rank_about(Vector3 centre_vx) const;
    // The long axis becomes this one (unit).
    void align(Vector3 axis);

  private:
    struct Wave {
        Vector3 axis;
        int degree;
        double amplitude;
    };
    void measure();
    std::array<Vector3, 3> axes_;
    std::array<double, 3> radii_;
    std::vector<Wave> waves_;
    double max_radius_ = 1, min_radius_ = 1;
};

// Directions spread evenly over the sphere (spiral of golden angles).
std::vector<Vector3> sphere_directions(int count);

struct MassEffect {
    Vector3 centre_vx;
    VoxelField rank;       // of the shape, RoughEllipsoid::rank_about
    double threshold = 1;  // of the rank, at the lesion's surface
    double share = 0.8;    // m: of its volume that pushes neighbours aside
    double reach = 2.5;    // radii
    LabelSet fixed;        // stay where they are: bone, skin, the outside
};

// Tissue around the lesion is pressed outwards. In shares q of the surface's radius, what ends at
// q >= 1 comes from
//
//     cbrt(q^3 - m w(q)),   w = (1 - s)^2 (1 + 2 s),  s = (q - 1) / (reach - 1)
//
// which rises with q wherever w falls, so that nothing folds, and is q beyond `reach`. Labels and
// records move; those of `fixed` neither move nor are covered. Returns the smallest determinant of
// the inverse map over the voxels that moved (> 0).
double push_aside(LabelCanvas& canvas, const MassEffect& effect);

// Interpolates the samples of a box trilinearly at `voxel`; `beyond` outside the box.
double sampled_at(const VoxelBox& box,
                  const std::vector<float>& values,
                  Vector3 voxel,
                  double beyond);

// A signed distance in a box of voxels, trilinear; `beyond` outside the box. Cheap to copy.
VoxelField sampled_field(const VoxelBox& box, std::vector<float> values, double beyond);

// The range of voxels that these labels take up, grown by `voxels` and cut to the grid.
VoxelRange range_of(const LabelVolume& volume, const LabelSet& labels, int voxels);
VoxelBox box_of(const VoxelRange& range);

// Height against gravity, in voxels: `down` is a unit vector.
VoxelField height_rank(Vector3 down);
// Signed distance to the labels, voxels, up to limit_mm.
VoxelField distance_to_labels(const LabelVolume& volume,
                              const LabelSet& labels,
                              const VoxelRange& range,
                              double limit_mm);
// Distance to a path of straight pieces, voxels.
VoxelField path_rank(std::vector<Vector3> path_vx);
// The larger of two signed distances: what both shapes have in common.
VoxelField intersection(VoxelField a, VoxelField b);
VoxelField ball(Vector3 centre_vx, double radius_vx);

// The direction in which the voxels of these labels extend most, near a point (unit).
Vector3 long_axis(const LabelCanvas& canvas,
                  const LabelSet& labels,
                  Vector3 near_vx,
                  double radius_vx);

}  // namespace sonocase::pipeline::inline pathology
