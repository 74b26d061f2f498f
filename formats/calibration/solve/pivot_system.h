// SPDX-License-Identifier: Apache-2.0

// The pivot problem over chosen poses in two forms: PivotSums, a few additions per pose, for the
// search; solve_pivots, an orthogonal factorisation, for the answer. Internal to
// formats/calibration.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/calibration/solve/least_squares.h"
#include "formats/recording/poses.h"

namespace sonocase::calibrate {

// Sums over poses from which tip and residual follow. R^T R = I makes the normal matrix
// n (I - Rm^T Rm), so a pose costs a few additions. Positions should be centred beforehand.
struct PivotSums {
    double n = 0;
    Matrix3 rotation = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};  // sum of R
    Vector3 position;                                  // sum of p
    Vector3 turned;                                    // sum of R^T p
    double square = 0;                                 // sum of |p|^2

    void add(const Rigid& pose);
    void add(const PivotSums& other);
    Matrix3 normal() const;  // sum (R - Rm)^T (R - Rm)
    Vector3 right() const;   // -sum (R - Rm)^T (p - pm)
    double spread() const;   // sum |p - pm|^2
    // |(R - Rm) t + (p - pm)|^2 summed.
    double residual(Vector3 tip) const;
    Point3 pivot(Vector3 tip) const;  // Rm t + pm
};

// x with A x = b for a symmetric positive definite A; false if it is singular to working precision.
bool solve_symmetric(const Matrix3& a, Vector3 b, Vector3* x);

// Groups of poses that share the tip, each with its own pivot.
using PoseGroup = std::vector<std::size_t>;

struct PivotSolution {
    LeastSquaresFit fit;  // unknowns: tip
    Vector3 tip;
    std::vector<Point3> pivots;          // # groups
    std::vector<Matrix3> mean_rotation;  // # groups
    double residual_sum = 0;
    std::int64_t poses = 0;
};

PivotSolution solve_pivots(std::span<const Pose> poses,
                           std::span<const PoseGroup> groups,
                           double rank_tolerance = 1e-12);

}  // namespace sonocase::calibrate
