// SPDX-License-Identifier: Apache-2.0

// The quadratic penalty on a B-spline displacement, as one scalar matrix for each of x, y and z.
#pragma once

#include <span>
#include <vector>

#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_fit {

// The grid without control points whose cells cover a box, centred on it.
DisplacementGrid grid_over(const Box3& box, double spacing_mm);

// The splines that are not zero at a point: index of the first control point, and 64 weights, x
// fastest.
struct SplineFootprint {
    std::size_t first = 0;
    float weight[64] = {};
};
SplineFootprint spline_footprint(const DisplacementGrid& grid, Point3 p);
// Offset of weight n from the first control point.
std::size_t footprint_offset(const DisplacementGrid& grid, int n);

// Rows of a symmetric matrix over control points that are at most three apart in each axis.
class SplinePenalty {
  public:
    // Means over the grid's box of |Hessian|^2 (per mm^2) and |gradient|^2, with these weights.
    SplinePenalty(const DisplacementGrid& grid, double hessian_weight, double gradient_weight);
    // Adds weight |d(p)|^2.
    void add_point(Point3 p, double weight);
    double diagonal(std::size_t control) const { return row_[control * 343 + 171]; }

    // out = M in, three components and one of padding; # control points.
    typedef float Lanes __attribute__((vector_size(16)));
    void apply(std::span<const Lanes> in, std::span<Lanes> out) const;

  private:
    DisplacementGrid grid_;   // without control points
    std::vector<float> row_;  // 7 x 7 x 7 per control point, x fastest
};

}  // namespace sonocase::pipeline::inline registration_fit
