// SPDX-License-Identifier: Apache-2.0

#include <cmath>

#include "pipeline/registration/warp/quadratic_rows.h"

namespace sonocase::pipeline {

RefineResult refine_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              std::span<const std::uint32_t> readings,
                              const RigidQuadratic& start,
                              const RefineOptions& options) {
    RefineResult result;
    result.map = start;
    RigidQuadratic& q = result.map;
    const std::vector<Point3> held = subsample(skin.points, 800);
    const ConstraintRows constraint =
        constraint_rows(q, held, options.constraint_mm, static_cast<double>(held.size()));
    for (int n = 0; n < options.iterations; ++n) {
        const double t =
            options.iterations > 1 ? static_cast<double>(n) / (options.iterations - 1) : 1;
        const double loss =
            options.first_loss_mm * std::pow(options.last_loss_mm / options.first_loss_mm, t);
        const double gate =
            options.first_gate_mm + t * (options.last_gate_mm - options.first_gate_mm);
        const Matches matches =
            match_quadratic(skin, target, readings, q, options.skin_queries, gate);
        if (matches.from_target.size() + matches.from_skin.size() < 30) break;
        const Rows gaps = gap_rows(skin, q, matches, loss);
        const Rows rest = held_rows(q, options, constraint, mean_turn(q, held));
        const Rows factor = triangle(stacked({&gaps, &rest}));
        if (n + 1 == options.iterations) {
            const Eigen::JacobiSVD<Eigen::MatrixXd> svd(factor.topLeftCorner(30, 30));
            result.condition = svd.singularValues()[0] / svd.singularValues()[29];
        }
        const Eigen::VectorXd k = solution(factor);
        if (!k.allFinite()) break;
        for (int d = 0; d < 3; ++d) {
            for (int c = 0; c < 10; ++c) {
                q.k[static_cast<std::size_t>(d)][static_cast<std::size_t>(c)] = k[10 * d + c];
            }
        }
    }
    const Matrix3 turn = mean_turn(q, held);
    for (int d = 0; d < 3; ++d) {
        Eigen::Matrix<double, 10, 1> off;
        for (int c = 0; c < 10; ++c)
            off[c] = q.k[static_cast<std::size_t>(d)][static_cast<std::size_t>(c)];
        off = constraint.left * off;
        for (int e = 0; e < 3; ++e) off -= turn(d, e) * constraint.right.col(e);
        result.constraint_cost += off.squaredNorm();
    }
    return result;
}

}  // namespace sonocase::pipeline
