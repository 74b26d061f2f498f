// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/solve/pivot_system.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::calibrate {

void PivotSums::add(const Rigid& pose) {
    n += 1;
    for (std::size_t k = 0; k < 9; ++k) rotation.m[k] += pose.rotation.m[k];
    position = position + pose.translation;
    turned = turned + transpose(pose.rotation) * pose.translation;
    square += dot(pose.translation, pose.translation);
}

void PivotSums::add(const PivotSums& other) {
    n += other.n;
    for (std::size_t k = 0; k < 9; ++k) rotation.m[k] += other.rotation.m[k];
    position = position + other.position;
    turned = turned + other.turned;
    square += other.square;
}

Matrix3 PivotSums::normal() const {
    const Matrix3 g = transpose(rotation) * rotation;
    Matrix3 a;
    for (std::size_t k = 0; k < 9; ++k) a.m[k] = (k % 4 == 0 ? n : 0.0) - g.m[k] / n;
    return a;
}

Vector3 PivotSums::right() const {
    return (transpose(rotation) * position) / n - turned;
}

double PivotSums::spread() const {
    return square - dot(position, position) / n;
}

double PivotSums::residual(Vector3 tip) const {
    return std::max(0.0, dot(tip, normal() * tip) - 2 * dot(tip, right()) + spread());
}

Point3 PivotSums::pivot(Vector3 tip) const {
    const Vector3 c = (rotation * tip + position) / n;
    return {c.x, c.y, c.z};
}

bool solve_symmetric(const Matrix3& a, Vector3 b, Vector3* x) {
    const double trace = a(0, 0) + a(1, 1) + a(2, 2);
    const double d = determinant(a);
    if (!(trace > 0) || !(d > 1e-14 * trace * trace * trace)) return false;
    *x = inverse(a) * b;
    return true;
}

PivotSolution solve_pivots(std::span<const Pose> poses,
                           std::span<const PoseGroup> groups,
                           double rank_tolerance) {
    PivotSolution solution;
    LeastSquares system(3);
    std::vector<Vector3> mean_position;
    for (const PoseGroup& group : groups) {
        // Two passes: the mean about the first position, so that a far origin costs no digits.
        Matrix3 mean = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};
        const Vector3 first = poses[group.front()].tracker_from_tool.translation;
        Vector3 offset;
        for (std::size_t i : group) {
            const Rigid& t = poses[i].tracker_from_tool;
            for (std::size_t k = 0; k < 9; ++k) mean.m[k] += t.rotation.m[k];
            offset = offset + (t.translation - first);
        }
        const auto n = static_cast<double>(group.size());
        for (double& v : mean.m) v /= n;
        offset = offset / n;
        for (std::size_t i : group) {
            const Rigid& t = poses[i].tracker_from_tool;
            const Vector3 p = (t.translation - first) - offset;
            for (int r = 0; r < 3; ++r) {
                const std::array<double, 3> row{t.rotation(r, 0) - mean(r, 0),
                                                t.rotation(r, 1) - mean(r, 1),
                                                t.rotation(r, 2) - mean(r, 2)};
                system.add(row.data(), -p[r]);
            }
        }
        solution.poses += static_cast<std::int64_t>(group.size());
        solution.mean_rotation.push_back(mean);
        mean_position.push_back(first + offset);
    }
    solution.fit = system.solve(rank_tolerance);
    solution.tip = {solution.fit.x[0], solution.fit.x[1], solution.fit.x[2]};
    solution.residual_sum = solution.fit.residual_sum;
    for (std::size_t g = 0; g < groups.size(); ++g) {
        const Vector3 c = solution.mean_rotation[g] * solution.tip + mean_position[g];
        solution.pivots.push_back({c.x, c.y, c.z});
    }
    return solution;
}

}  // namespace sonocase::calibrate
