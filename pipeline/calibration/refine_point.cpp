// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/refine_point.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <cassert>
#include <chrono>
#include <cmath>
#include <vector>

#include "formats/calibration/pose_screen.h"

namespace sonocase::pipeline::inline calibration {
namespace {

struct TipOnPivot {
    Rigid pose;
    double sigma;
    template <class T>
    bool operator()(const T* tip, const T* pivot, const T* turn, T* residual) const {
        T turned[3];
        ceres::AngleAxisRotatePoint(turn, tip, turned);
        for (int r = 0; r < 3; ++r) {
            residual[r] = (pose.rotation(r, 0) * turned[0] + pose.rotation(r, 1) * turned[1] +
                           pose.rotation(r, 2) * turned[2] + pose.translation[r] - pivot[r]) /
                          sigma;
        }
        return true;
    }
};

struct SmallTurn {
    double sigma;
    template <class T>
    bool operator()(const T* turn, T* residual) const {
        for (int k = 0; k < 3; ++k) residual[k] = turn[k] / sigma;
        return true;
    }
};

}  // namespace

RefinePointResult refine_point(std::span<const Pose> readings,
                               const PointFit& start,
                               const RefinePointOptions& options) {
    assert(start.determined && options.position_sigma_mm > 0 && options.rotation_sigma_rad > 0);
    const auto began = std::chrono::steady_clock::now();
    RefinePointResult out;
    const std::vector<Pose> poses = screen_poses(readings).poses;
    // Places are taken about the pivot, so that a far origin costs no digits.
    const Vector3 origin{start.pivot_mm.x, start.pivot_mm.y, start.pivot_mm.z};
    double tip[3] = {start.tip_mm.x, start.tip_mm.y, start.tip_mm.z};
    double pivot[3] = {0, 0, 0};
    std::vector<std::array<double, 3>> turns(poses.size(), {0, 0, 0});
    ceres::Problem problem;
    auto* order = new ceres::ParameterBlockOrdering;
    std::size_t used = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        if (i < start.residuals.size() && !start.residuals[i].inlier) continue;
        Rigid pose = poses[i].tracker_from_tool;
        pose.translation = pose.translation - origin;
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<TipOnPivot, 3, 3, 3, 3>(
                                     new TipOnPivot{pose, options.position_sigma_mm}),
                                 new ceres::CauchyLoss(3), tip, pivot, turns[i].data());
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SmallTurn, 3, 3>(
                                     new SmallTurn{options.rotation_sigma_rad}),
                                 nullptr, turns[i].data());
        order->AddElementToGroup(turns[i].data(), 0);
        ++used;
    }
    if (used < 3) {
        delete order;
        return out;
    }
    order->AddElementToGroup(tip, 1);
    order->AddElementToGroup(pivot, 1);
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.linear_solver_ordering.reset(order);
    solver.max_num_iterations = options.max_iterations;
    solver.function_tolerance = 1e-12;
    solver.num_threads = 1;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    out.converged = summary.termination_type == ceres::CONVERGENCE;
    out.iterations = static_cast<int>(summary.iterations.size());
    out.tip_mm = {tip[0], tip[1], tip[2]};
    out.pivot_mm = Point3{pivot[0], pivot[1], pivot[2]} + origin;
    out.moved_mm = norm(out.tip_mm - start.tip_mm);

    double square = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        if (i < start.residuals.size() && !start.residuals[i].inlier) continue;
        double residual[3];
        Rigid pose = poses[i].tracker_from_tool;
        pose.translation = pose.translation - origin;
        TipOnPivot{pose, 1.0}(tip, pivot, turns[i].data(), residual);
        for (double r : residual) square += r * r;
    }
    out.rms_mm = std::sqrt(square / static_cast<double>(used));
    ceres::Covariance::Options how;
    how.algorithm_type = ceres::SPARSE_QR;
    ceres::Covariance covariance(how);
    double block[9];
    const double unscaled =
        std::max(1.0, 2 * summary.final_cost / std::max(1.0, 3.0 * static_cast<double>(used) - 6));
    const std::vector<std::pair<const double*, const double*>> wanted{{tip, tip}};
    if (covariance.Compute(wanted, &problem) && covariance.GetCovarianceBlock(tip, tip, block)) {
        out.sigma_mm = {std::sqrt(unscaled * block[0]), std::sqrt(unscaled * block[4]),
                        std::sqrt(unscaled * block[8])};
    } else {
        out.sigma_mm = {INFINITY, INFINITY, INFINITY};
    }
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    return out;
}

}  // namespace sonocase::pipeline::inline calibration
