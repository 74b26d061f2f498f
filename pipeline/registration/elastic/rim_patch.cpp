// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/rim_patch.h"

#include <Eigen/Dense>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

constexpr int kNeighbours = 36;
constexpr double kSharpestCurvature = 1 / 40.0;  // per mm; a sharper patch is noise

}  // namespace

RimPatches::RimPatches(const TargetSurface& target, std::span<const std::uint32_t> readings)
    : target_(target), patch_of_(target.points.size(), -1) {
    std::vector<std::uint32_t> rim;
    for (const std::uint32_t j : readings) {
        if (!target.on_rim[j] || target.lifted[j]) continue;
        patch_of_[j] = static_cast<std::int32_t>(rim.size());
        rim.push_back(j);
    }
    patches_.resize(rim.size());
    parallel_for(rim.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const std::uint32_t j = rim[n];
            Patch& patch = patches_[n];
            patch.u = any_perpendicular(target.normals[j]);
            patch.v = cross(target.normals[j], patch.u);
            const auto near = target.index.nearest(target.points[j], kNeighbours);
            Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
            Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
            int used = 0;
            for (const std::uint32_t i : near) {
                if (target.lifted[i] || dot(target.normals[i], target.normals[j]) < 0.3) continue;
                const Vector3 d = target.points[i] - target.points[j];
                // Scaled by 30 mm, so that the columns are of one size.
                const double a = dot(d, patch.u) / kReach_mm, b = dot(d, patch.v) / kReach_mm;
                Eigen::Matrix<double, 6, 1> row;
                row << 1, a, b, a * a, a * b, b * b;
                const double w = 1 / (1 + a * a + b * b);
                normal += w * row * row.transpose();
                right += w * dot(d, target.normals[j]) * row;
                ++used;
            }
            if (used < 12) continue;
            // A little weight on small curvature keeps one-sided neighbourhoods determined.
            for (int m = 3; m < 6; ++m) normal(m, m) += 0.02;
            const Eigen::Matrix<double, 6, 1> c = normal.ldlt().solve(right);
            for (int m = 0; m < 6; ++m) {
                patch.c[m] = c[m] / (m == 0 ? 1 : m < 3 ? kReach_mm : kReach_mm * kReach_mm);
            }
            patch.good = std::isfinite(c.sum()) &&
                         std::abs(patch.c[3]) + std::abs(patch.c[4]) + std::abs(patch.c[5]) <
                             kSharpestCurvature;
        }
    });
}

RimPatches::Foot RimPatches::foot(std::uint32_t reading, Point3 p) const {
    Foot foot;
    const std::int32_t n = patch_of_[reading];
    if (n < 0 || !patches_[static_cast<std::size_t>(n)].good) return foot;
    const Patch& patch = patches_[static_cast<std::size_t>(n)];
    const Vector3 normal = target_.normals[reading], d = p - target_.points[reading];
    const double a = dot(d, patch.u), b = dot(d, patch.v);
    if (a * a + b * b > kReach_mm * kReach_mm) return foot;
    const double* c = patch.c;
    const double height = c[0] + c[1] * a + c[2] * b + c[3] * a * a + c[4] * a * b + c[5] * b * b;
    const double slope_a = c[1] + 2 * c[3] * a + c[4] * b, slope_b = c[2] + c[4] * a + 2 * c[5] * b;
    foot.normal = normalized(normal - (slope_a * patch.u + slope_b * patch.v));
    foot.gap_mm = (dot(d, normal) - height) * dot(foot.normal, normal);
    foot.found = true;
    return foot;
}

}  // namespace sonocase::pipeline
