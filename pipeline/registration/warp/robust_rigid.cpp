// SPDX-License-Identifier: Apache-2.0

// The rigid refinement by Ceres: the only file of this room that includes it.
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <cmath>

#include "pipeline/registration/warp/quadratic_warp.h"
#include "pipeline/registration/warp/rigid_alignment.h"

namespace sonocase::pipeline {
namespace {

template <class T>
void rotate(const T* turn, Vector3 v, T* to) {
    const T from[3] = {T(v.x), T(v.y), T(v.z)};
    ceres::AngleAxisRotatePoint(turn, from, to);
}

// weight (normal . (turn * p + shift - place)); p is the skin point rotated by the start.
struct Gap {
    Vector3 p, place, normal;
    double weight;
    template <class T>
    bool operator()(const T* turn, const T* shift, T* residual) const {
        T to[3];
        rotate(turn, p, to);
        residual[0] = weight * (normal.x * (to[0] + shift[0] - place.x) +
                                normal.y * (to[1] + shift[1] - place.y) +
                                normal.z * (to[2] + shift[2] - place.z));
        return true;
    }
};

struct Place {
    Vector3 p, place;
    double weight;
    template <class T>
    bool operator()(const T* turn, const T* shift, T* residual) const {
        T to[3];
        rotate(turn, p, to);
        residual[0] = weight * (to[0] + shift[0] - place.x);
        residual[1] = weight * (to[1] + shift[1] - place.y);
        residual[2] = weight * (to[2] + shift[2] - place.z);
        return true;
    }
};

struct Head {
    Vector3 head, up;
    double weight;
    template <class T>
    bool operator()(const T* turn, T* residual) const {
        T to[3];
        rotate(turn, head, to);
        residual[0] = weight * (to[0] - up.x);
        residual[1] = weight * (to[1] - up.y);
        residual[2] = weight * (to[2] - up.z);
        return true;
    }
};

template <class Cost, int... Sizes>
ceres::CostFunction* automatic(const Cost& cost) {
    return new ceres::AutoDiffCostFunction<Cost, Sizes...>(new Cost(cost));
}

}  // namespace

Rigid refine_rigid_robust(const SkinModel& skin,
                          const TargetSurface& target,
                          const Rigid& start,
                          const PoseHints& hints,
                          double loss_mm,
                          int rounds) {
    Rigid pose = start;
    const std::vector<std::uint32_t> readings = thin_target(target, 1.2 * target.spacing_mm);
    const std::size_t stride = std::max<std::size_t>(1, skin.points.size() / 1200);
    for (int round = 0; round < rounds; ++round) {
        MatchOptions gates;
        gates.farthest_mm = 60;
        gates.side_step_mm = 1.2 * target.spacing_mm;
        const MappedSkin mapped = map_skin(skin, RigidQuadratic::from_rigid(pose));
        const Matches matches = find_matches(skin, mapped.points, mapped.normals, mapped.index,
                                             target, readings, stride, gates);
        if (matches.from_target.size() + matches.from_skin.size() < 30) return pose;
        double turn[3] = {0, 0, 0};
        double shift[3] = {pose.translation.x, pose.translation.y, pose.translation.z};
        ceres::Problem problem;
        const auto add = [&](const std::vector<Match>& list) {
            // Scaled after the loss, so that both directions have the same total weight.
            const double share = 1 / static_cast<double>(std::max<std::size_t>(1, list.size()));
            for (const Match& m : list) {
                const Vector3 p = pose.rotation * (skin.points[m.skin] - Point3{});
                auto* loss = new ceres::ScaledLoss(new ceres::CauchyLoss(loss_mm), share,
                                                   ceres::TAKE_OWNERSHIP);
                problem.AddResidualBlock(
                    automatic<Gap, 1, 3, 3>(Gap{p, m.place - Point3{}, m.normal, 1}), loss, turn,
                    shift);
            }
        };
        add(matches.from_target);
        add(matches.from_skin);
        for (const PoseHints::Place& place : hints.landmarks) {
            const Vector3 p = pose.rotation * (place.skin - Point3{});
            problem.AddResidualBlock(
                automatic<Place, 3, 3, 3>(
                    Place{p, place.target - Point3{}, std::sqrt(2 * hints.landmark_weight)}),
                new ceres::CauchyLoss(60 * std::sqrt(2 * hints.landmark_weight)), turn, shift);
        }
        if (hints.up) {
            problem.AddResidualBlock(
                automatic<Head, 3, 3>(
                    Head{pose.rotation.column(2), *hints.up, std::sqrt(2 * hints.up_weight_mm2)}),
                nullptr, turn);
        }
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_QR;
        options.max_num_iterations = 8;
        options.num_threads = 1;  // the order of summation affects the result
        options.logging_type = ceres::SILENT;
        ceres::Solver::Summary summary;
        ceres::Solve(options, &problem, &summary);
        if (!summary.IsSolutionUsable()) return pose;
        const Vector3 axis{turn[0], turn[1], turn[2]};
        const Rigid next{
            nearest_rotation(rotation_about(normalized(axis), norm(axis)) * pose.rotation),
            {shift[0], shift[1], shift[2]}};
        const bool at_rest = same_pose(next, pose, 1e-4, 0.02);
        pose = next;
        if (at_rest) break;
    }
    return pose;
}

}  // namespace sonocase::pipeline
