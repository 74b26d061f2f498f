// SPDX-License-Identifier: Apache-2.0

// The inverse of the fitted map at single points and at the knots of a row. Internal to
// pipeline/registration/map; inverse_map.h is the contract.
#pragma once

#include <limits>
#include <vector>

#include "pipeline/registration/map/image_of_box.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/map/map_evaluator.h"

namespace sonocase::pipeline {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Rounding of a point that was on the face of the box.
inline constexpr double kBoxSlack_mm = 1e-6;

// A solved point of a row: its preimage relative to the CT centre, and how that moves along the
// row.
struct Knot {
    int index = 0;
    bool solved = false;
    Vector3 ct;
    Vector3 rate;  // per point of the row
};

struct PointInverse {
    explicit PointInverse(const Registration& r);

    // Damped Newton from `start`; true if it converged.
    bool newton(Point3 y, Point3 start, Point3* ct) const;
    // As InverseMap::invert.
    MapStatus invert(Point3 y, Point3* ct) const;

    // Point start + index * step of a row. solve_knot: a few Newton steps from a near guess
    // (relative to the CT centre); search_knot: without a guess, slow and certain.
    Knot solve_knot(Point3 start, Vector3 step, int index, Vector3 guess) const;
    Knot search_knot(Point3 start, Vector3 step, int index) const;

    Registration registration;
    MapEvaluator evaluate;
    std::vector<ImageOfBox> image;  // none if the box is empty
    QuadraticMap approximate;       // the map fitted with its sides exchanged
    // Points of the box and their images, the starts for points that defeat the approximate
    // inverse.
    std::vector<Point3> lattice_ct, lattice_mannequin;
    double longest_step_mm = 100;
    double magnitude = 0;
};

}  // namespace sonocase::pipeline
