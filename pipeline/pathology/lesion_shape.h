// SPDX-License-Identifier: Apache-2.0

// The shape of a rounded lesion, and its mass effect on the tissue around it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"
#include "pipeline/pathology/label_canvas.h"

namespace sonocase::pipeline {

// Radius of a lesion by direction, of unit volume 4 pi / 3 but for its roughness:
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
    double greatest_radius() const { return greatest_; }
    double least_radius() const { return least_; }
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
    double greatest_ = 1, least_ = 1;
};

// Directions spread evenly over the sphere (spiral of golden angles).
std::vector<Vector3> sphere_directions(int count);

struct MassEffect {
    Vector3 centre_vx;
    VoxelField rank;       // of the shape, RoughEllipsoid::rank_about
    double threshold = 1;  // of the rank, at the lesion's surface
    double share = 0.8;    // m: of its volume that pushes neighbours aside
    double reach = 2.5;    // radii
    Labels fixed;          // stay where they are: bone, skin, the outside
};

// Tissue around the lesion is pressed outwards. In shares q of the surface's radius, what ends at
// q >= 1 comes from
//
//     cbrt(q^3 - m w(q)),   w = (1 - s)^2 (1 + 2 s),  s = (q - 1) / (reach - 1)
//
// which rises with q wherever w falls, so that nothing folds, and is q beyond `reach`. Labels and
// records move; those of `fixed` neither move nor are covered. Returns the least determinant of the
// inverse map over the voxels moved (> 0).
double push_aside(LabelCanvas& canvas, const MassEffect& effect);

}  // namespace sonocase::pipeline
