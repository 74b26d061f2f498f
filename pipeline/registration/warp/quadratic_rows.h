// SPDX-License-Identifier: Apache-2.0

// Rows of the least-squares systems of the quadratic warp. Internal to
// pipeline/registration/warp; the one header of this room that holds Eigen's types.
//
// The 30 unknowns are the 10 coefficients of each dimension of K in turn; the last column of a
// system is the right-hand side.
#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "pipeline/registration/warp/quadratic_warp.h"

namespace sonocase::pipeline {

using Row10 = Eigen::Matrix<double, 1, 10>;
using Rows = Eigen::MatrixXd;  // 31 columns

// The coordinate w = R x / scale of a skin point.
inline Vector3 scaled(const RigidQuadratic& q, Point3 skin) {
    return (q.rigid.rotation * (skin - Point3{})) / q.scale_mm;
}

// b(w) of eq. (3).
inline Row10 basis(Vector3 w) {
    Row10 b;
    b << 1, w.x, w.y, w.z, w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.x * w.z, w.y * w.z;
    return b;
}

// The constraint rows of many points reduced to ten: the triangular factor of the stacked slopes,
// and the right-hand sides of the three dimensions.
struct ConstraintRows {
    Eigen::Matrix<double, 10, 10> left = Eigen::Matrix<double, 10, 10>::Zero();
    Eigen::Matrix<double, 10, 3> right = Eigen::Matrix<double, 10, 3>::Zero();
};

// Rows of weight_mm^2 * (sum over points of |dq/dz - I|^2) / divisor.
ConstraintRows constraint_rows(const RigidQuadratic& q,
                               std::span<const Point3> skin,
                               double weight_mm,
                               double divisor);

// The mean rotation of the map beyond that of the rigid pose. The constraint is taken about it:
// "rigid" in (4)-(6) must not mean the tilt at which the rigid fit of two unlike bodies ended.
Matrix3 mean_turn(const RigidQuadratic& q, const std::vector<Point3>& held);

Matches match_quadratic(const SkinModel& skin,
                        const TargetSurface& target,
                        std::span<const std::uint32_t> readings,
                        const RigidQuadratic& q,
                        int skin_queries,
                        double gate_mm);

// One weighted row per match: w n . (K b) = w n . place. Both directions have the same total
// weight.
Rows gap_rows(const SkinModel& skin,
              const RigidQuadratic& q,
              const Matches& matches,
              double loss_mm);

// The rows of the landmarks, and of the constraint about `turn`.
Rows held_rows(const RigidQuadratic& q,
               const RefineOptions& options,
               const ConstraintRows& constraint,
               const Matrix3& turn);

// The triangular factor of the rows with the right-hand side (31 x 31): all that a fit needs.
Rows triangle(Rows rows);
Eigen::VectorXd solution(const Rows& factor);
Rows stacked(const std::vector<const Rows*>& parts);

}  // namespace sonocase::pipeline
