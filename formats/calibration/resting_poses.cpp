// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/resting_poses.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/solve/pivot_search.h"
#include "formats/calibration/solve/statistics.h"

namespace sonocase::calibrate {
namespace {

std::vector<double> residuals_of(std::span<const Pose> poses, Vector3 tip, Point3 pivot) {
    std::vector<double> out;
    out.reserve(poses.size());
    for (const Pose& pose : poses) {
        out.push_back(distance(pose.tracker_from_tool * Point3{tip.x, tip.y, tip.z}, pivot));
    }
    return out;
}

PoseGroup within(const std::vector<double>& residuals, double limit) {
    PoseGroup kept;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
        if (residuals[i] <= limit) kept.push_back(i);
    }
    return kept;
}

// The poses that one resting point explains. Starts from all poses, unless the search finds a tip
// with a far smaller median residual: outliers then hide in the plain fit. Ends when the set of
// poses no longer changes.
PoseGroup one_rest(std::span<const Pose> poses, const PointOptions& options) {
    const PoseGroup all = all_poses(poses.size());
    if (!options.reject_outliers || poses.size() < 6) return all;
    const PivotSolution plain = solve_pivots(poses, std::span(&all, 1));
    std::vector<double> residuals = residuals_of(poses, plain.tip, plain.pivots[0]);
    double middle = median(residuals);

    Vector3 tip;
    if (search_tip(poses, options.trials, options.seed, &tip)) {
        std::vector<Vector3> tips;
        for (const Pose& pose : poses) {
            const Point3 p = pose.tracker_from_tool * Point3{tip.x, tip.y, tip.z};
            tips.push_back({p.x, p.y, p.z});
        }
        // Pivot of the search: where most tips meet, by medians.
        Point3 pivot;
        for (int c = 0; c < 3; ++c) {
            std::vector<double> v;
            for (const Vector3& t : tips) v.push_back(t[c]);
            pivot[c] = median(std::move(v));
        }
        std::vector<double> found = residuals_of(poses, tip, pivot);
        const double found_middle = median(found);
        if (found_middle < 0.7 * middle) {
            residuals = std::move(found);
            middle = found_middle;
        }
    }

    // A floor of a nanometre keeps rounding errors of exact data from being called outliers.
    constexpr double kFloor = 1e-6;
    PoseGroup kept = within(residuals, options.outlier_sigmas * middle / kMedianLength3 + kFloor);
    for (int round = 0; round < 30 && kept.size() >= 4; ++round) {
        const PivotSolution fit = solve_pivots(poses, std::span(&kept, 1));
        residuals = residuals_of(poses, fit.tip, fit.pivots[0]);
        // The median over all poses stands below one half of outliers and does not creep inwards.
        const double sigma = median(residuals) / kMedianLength3;
        PoseGroup next = within(residuals, options.outlier_sigmas * sigma + kFloor);
        if (next == kept) break;
        kept = std::move(next);
    }
    return kept.size() >= 4 ? kept : all;
}

// Leaves out the poses of each rest that lie far from it, by the scatter over all rests.
void trim_rests(std::span<const Pose> poses,
                const PointOptions& options,
                std::vector<PoseGroup>& rests) {
    for (int round = 0; round < 3; ++round) {
        const PivotSolution fit = solve_pivots(poses, rests);
        std::vector<double> all;
        for (std::size_t g = 0; g < rests.size(); ++g) {
            for (std::size_t i : rests[g]) {
                all.push_back(
                    distance(poses[i].tracker_from_tool * Point3{fit.tip.x, fit.tip.y, fit.tip.z},
                             fit.pivots[g]));
            }
        }
        if (all.empty()) return;
        const double limit = options.outlier_sigmas * median(all) / kMedianLength3 + 1e-6;
        std::size_t at = 0, dropped = 0;
        for (PoseGroup& rest : rests) {
            PoseGroup next;
            for (std::size_t i : rest) {
                if (all[at++] <= limit) next.push_back(i);
            }
            dropped += rest.size() - next.size();
            rest = std::move(next);
        }
        std::erase_if(rests, [](const PoseGroup& g) { return g.size() < 5; });
        if (dropped == 0) return;
    }
}

// Degrees of freedom: three equations per pose; the tip and each pivot take three.
double freedom(const PivotSolution& s, std::size_t groups) {
    return std::max(1.0, static_cast<double>(3 * s.poses) - 3 - 3 * static_cast<double>(groups));
}

}  // namespace

PoseGroup all_poses(std::size_t count) {
    PoseGroup all(count);
    for (std::size_t i = 0; i < count; ++i) all[i] = i;
    return all;
}

double residual_sigma_mm(const PivotSolution& s, std::size_t groups) {
    return std::sqrt(s.residual_sum / freedom(s, groups));
}

std::vector<PoseGroup> resting_poses(std::span<const Pose> poses, const PointOptions& options) {
    std::vector<PoseGroup> groups{options.rests == RestSearch::several ? PoseGroup{}
                                                                       : one_rest(poses, options)};
    double one_sigma = INFINITY;
    if (!groups[0].empty()) one_sigma = residual_sigma_mm(solve_pivots(poses, groups), 1);
    const bool one_is_poor = one_sigma > 1 || 10 * groups[0].size() < 8 * poses.size();
    if (options.rests != RestSearch::one && one_is_poor) {
        std::vector<PoseGroup> rests = search_rests(poses, options.seed);
        if (options.reject_outliers) trim_rests(poses, options, rests);
        std::size_t covered = 0;
        for (const PoseGroup& g : rests) covered += g.size();
        const bool enough = rests.size() >= 2 && 10 * covered >= 3 * poses.size();
        if (enough &&
            residual_sigma_mm(solve_pivots(poses, rests), rests.size()) < 0.3 * one_sigma) {
            groups = std::move(rests);
        }
    }
    if (groups[0].empty()) groups[0] = all_poses(poses.size());
    return groups;
}

}  // namespace sonocase::calibrate
