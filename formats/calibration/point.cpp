// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/point.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "formats/calibration/pivot_system.h"
#include "formats/calibration/pose_screen.h"
#include "formats/calibration/words.h"

namespace sonocase {
namespace {

using calibrate::PivotSolution;
using calibrate::PoseGroup;
using calibrate::solve_pivots;

using calibrate::axis_text;
using calibrate::kDegree;
using calibrate::median;
using calibrate::text;
constexpr double kMedianLength = calibrate::kMedianLength3;

std::vector<double> residuals_of(std::span<const Pose> poses, Vector3 tip, Point3 pivot) {
    std::vector<double> out;
    out.reserve(poses.size());
    for (const Pose& pose : poses) {
        out.push_back(distance(pose.tracker_from_tool * Point3{tip.x, tip.y, tip.z}, pivot));
    }
    return out;
}

PoseGroup everything(std::size_t count) {
    PoseGroup all(count);
    for (std::size_t i = 0; i < count; ++i) all[i] = i;
    return all;
}

PoseGroup within(const std::vector<double>& residuals, double limit) {
    PoseGroup kept;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
        if (residuals[i] <= limit) kept.push_back(i);
    }
    return kept;
}

// Which poses one resting point explains. Starts from all poses unless the search finds a tip that
// fits the middle pose far better: outliers then hide in the plain fit. Ends where the set repeats.
PoseGroup one_rest(std::span<const Pose> poses, const PointOptions& options) {
    const PoseGroup all = everything(poses.size());
    if (!options.reject_outliers || poses.size() < 6) return all;
    const PivotSolution plain = solve_pivots(poses, std::span(&all, 1));
    std::vector<double> residuals = residuals_of(poses, plain.tip, plain.pivots[0]);
    double middle = median(residuals);

    Vector3 tip;
    if (calibrate::search_tip(poses, options.trials, options.seed, &tip)) {
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
    PoseGroup kept = within(residuals, options.outlier_sigmas * middle / kMedianLength + kFloor);
    for (int round = 0; round < 30 && kept.size() >= 4; ++round) {
        const PivotSolution fit = solve_pivots(poses, std::span(&kept, 1));
        residuals = residuals_of(poses, fit.tip, fit.pivots[0]);
        // The median over all poses stands below one half of outliers and does not creep inwards.
        const double sigma = median(residuals) / kMedianLength;
        PoseGroup next = within(residuals, options.outlier_sigmas * sigma + kFloor);
        if (next == kept) break;
        kept = std::move(next);
    }
    return kept.size() >= 4 ? kept : all;
}

// Leaves out poses of each rest that lie far off it, by the pooled scatter.
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
        const double limit = options.outlier_sigmas * median(all) / kMedianLength + 1e-6;
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

double freedom(const PivotSolution& s, std::size_t groups) {
    return std::max(1.0, static_cast<double>(3 * s.poses) - 3 - 3 * static_cast<double>(groups));
}

double sigma_of(const PivotSolution& s, std::size_t groups) {
    return std::sqrt(s.residual_sum / freedom(s, groups));
}

// Correlation between residual vectors of successive poses in a group; 0 if not beyond chance.
double residual_correlation(std::span<const Pose> poses,
                            const PivotSolution& fit,
                            const std::vector<PoseGroup>& groups) {
    double product = 0, square = 0;
    std::int64_t pairs = 0;
    for (std::size_t g = 0; g < groups.size(); ++g) {
        Vector3 before;
        for (std::size_t k = 0; k < groups[g].size(); ++k) {
            const Rigid& t = poses[groups[g][k]].tracker_from_tool;
            const Vector3 r = (t * Point3{fit.tip.x, fit.tip.y, fit.tip.z}) - fit.pivots[g];
            square += dot(r, r);
            if (k > 0) {
                product += dot(before, r);
                ++pairs;
            }
            before = r;
        }
    }
    if (pairs < 10 || !(square > 0)) return 0;
    const double rho = product / square;
    return rho > 2 / std::sqrt(3.0 * static_cast<double>(pairs)) ? std::min(rho, 0.98) : 0;
}

Vector3 root_of_diagonal(const Matrix3& a) {
    return {std::sqrt(std::max(0.0, a(0, 0))), std::sqrt(std::max(0.0, a(1, 1))),
            std::sqrt(std::max(0.0, a(2, 2)))};
}

Matrix3 tip_covariance(const LeastSquaresFit& fit, double variance) {
    Matrix3 c;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            // Infinite stays infinite even where the readings left no residual.
            const double q = fit.covariance(i, j);
            c(i, j) = std::isinf(q) ? q : variance * q;
        }
    }
    return c;
}

// Would the rotations read the other way round explain the recording? Then the export is inverted.
void hint_at_conventions(std::span<const Pose> poses, double sigma, PointFit& out) {
    if (poses.size() < 10 || sigma < 2) return;
    std::vector<Pose> turned(poses.begin(), poses.end());
    for (Pose& p : turned) p.tracker_from_tool.rotation = transpose(p.tracker_from_tool.rotation);
    const PoseGroup all = everything(poses.size());
    const double plain = sigma_of(solve_pivots(poses, std::span(&all, 1)), 1);
    if (sigma_of(solve_pivots(turned, std::span(&all, 1)), 1) < 0.25 * plain) {
        out.warnings.push_back(
            "The readings fit far better with every rotation transposed; the export "
            "writes rotations column by column: write them row by row.");
    }
}

void judge_motion(double sigma, double widest, std::size_t poses, PointFit& out) {
    // 0.2 degrees rms is what a resting tracker shows; below a two-hundredth of the largest swing a
    // direction is noise of the others.
    constexpr double kStill = 0.2 * kDegree, kShare = 0.005;
    if (poses < 3) {
        out.problem = text(
            "%zu usable pose%s; at least 3 are needed and 30 or more are better: rest the "
            "tip on a fixed point and tilt the tool every way",
            poses, poses == 1 ? "" : "s");
        return;
    }
    if (widest < kStill) {
        out.problem = text(
            "the sensor stood still (it turned by %.2f degrees), so nothing tells where "
            "the tip is; keep the tip on a fixed point and tilt the tool 30 degrees or "
            "more every way",
            widest / kDegree);
        return;
    }
    const double least = out.swing.z;
    if (least < 0.5 * kStill || least < kShare * out.swing.x) {
        out.problem =
            "rotation so far is about one axis, " + axis_text(out.weak_axis) +
            " of the sensor, and the tip is undetermined along it; tilt the tool sideways as "
            "well, about another axis";
        return;
    }
    out.determined = true;
    if (out.weak_sigma_mm > 0.5 || least < 3 * kDegree) {
        out.warnings.push_back(text(
            "The tip is known least along %s of the sensor: one standard deviation is %.2g mm, the "
            "tool swung only %.1f degrees rms across it; tilt it further, at right angles to that "
            "axis.",
            axis_text(out.weak_axis).c_str(), out.weak_sigma_mm,
            std::asin(std::min(1.0, least)) / kDegree));
    }
    if (sigma > 2) {
        out.warnings.push_back(
            text("Residuals are large (%.1f mm rms); the tip slid on its resting point, "
                 "the sensor is loose, or metal disturbs the tracker: fix that and "
                 "record again.",
                 sigma));
    }
}

}  // namespace

PointFit fit_point(std::span<const Pose> readings, const PointOptions& options) {
    assert(options.outlier_sigmas > 3 && options.trials >= 1);
    PointFit out;
    PoseScreen screen = screen_poses(readings);
    out.warnings = std::move(screen.warnings);
    const std::vector<Pose>& usable = screen.poses;
    out.poses = static_cast<int>(usable.size());
    if (usable.size() < 3) {
        out.sigma_mm = out.pivot_sigma_mm = {INFINITY, INFINITY, INFINITY};
        out.condition = out.weak_sigma_mm = INFINITY;
        judge_motion(0, 0, usable.size(), out);
        if (usable.size() == 2) {
            out.problem =
                "2 usable poses leave the tip open along the axis of the turn between them; at "
                "least 3 are needed and 30 or more are better: tilt the tool every way";
        }
        return out;
    }

    // Everything below sees positions about their mean: a far origin costs no digits.
    std::vector<Pose> poses = usable;
    Vector3 origin;
    const Vector3 first = poses[0].tracker_from_tool.translation;
    for (const Pose& p : poses) {
        origin =
            origin + (p.tracker_from_tool.translation - first) / static_cast<double>(poses.size());
    }
    origin = first + origin;
    for (Pose& p : poses)
        p.tracker_from_tool.translation = p.tracker_from_tool.translation - origin;

    std::vector<PoseGroup> groups{options.rests == RestSearch::several ? PoseGroup{}
                                                                       : one_rest(poses, options)};
    double one_sigma = INFINITY;
    if (!groups[0].empty()) one_sigma = sigma_of(solve_pivots(poses, groups), 1);
    const bool one_is_poor = one_sigma > 1 || 10 * groups[0].size() < 8 * poses.size();
    if (options.rests != RestSearch::one && one_is_poor) {
        std::vector<PoseGroup> rests = calibrate::search_rests(poses, options.seed);
        if (options.reject_outliers) trim_rests(poses, options, rests);
        std::size_t covered = 0;
        for (const PoseGroup& g : rests) covered += g.size();
        const bool enough = rests.size() >= 2 && 10 * covered >= 3 * poses.size();
        if (enough && sigma_of(solve_pivots(poses, rests), rests.size()) < 0.3 * one_sigma) {
            groups = std::move(rests);
        }
    }
    if (groups[0].empty()) groups[0] = everything(poses.size());

    PivotSolution fit = solve_pivots(poses, groups);
    const double root_n = std::sqrt(static_cast<double>(fit.poses));
    for (int k = 0; k < 3; ++k) {
        out.swing[k] = fit.fit.singular[static_cast<std::size_t>(k)] / root_n;
    }
    out.weak_axis = {fit.fit.direction[2][0], fit.fit.direction[2][1], fit.fit.direction[2][2]};
    const double correlation = residual_correlation(poses, fit, groups);
    const double sigma = sigma_of(fit, groups.size());
    // Successive readings that share their error count for less than their number.
    const double widened = sigma * std::sqrt((1 + correlation) / (1 - correlation));
    out.correlation = correlation;
    out.weak_sigma_mm = widened / fit.fit.singular[2];
    // Singular values of the whole system are sqrt(N (1 +- s)), s those of the mean rotation;
    // written with the swing, 1 - s has no cancellation.
    const double least = out.swing.z;
    out.condition = (1 + std::sqrt(std::max(0.0, 1 - least * least))) / least;
    judge_motion(sigma, out.swing.x, poses.size(), out);
    if (!out.determined) {
        // Again without the open directions, so that noise does not fill them.
        const double open = std::max(0.1 * kDegree, 0.005 * out.swing.x) * 1.0000001;
        fit = solve_pivots(poses, groups, std::min(0.5, open / std::max(out.swing.x, 1e-300)));
        out.weak_sigma_mm = out.condition = INFINITY;
        if (out.swing.x < 0.2 * kDegree) {
            fit.tip = {0, 0, 0};
            for (int k = 0; k < 3; ++k) fit.fit.singular[static_cast<std::size_t>(k)] = 0;
            fit.fit.rank = 0;
        }
    }

    out.tip_mm = fit.tip;
    out.d1_mm = fit.tip.x;
    out.d2_mm = std::hypot(fit.tip.y, fit.tip.z);
    out.theta_rad = std::atan2(fit.tip.z, fit.tip.y);
    const Matrix3 covariance = tip_covariance(fit.fit, widened * widened);
    out.sigma_mm = root_of_diagonal(covariance);
    out.inliers = static_cast<int>(fit.poses);

    out.residuals.reserve(poses.size());
    for (const Pose& p : poses) out.residuals.push_back({p.frame, p.timestamp_s, 0, false, -1});
    std::size_t largest = 0;
    double square_sum = 0;
    const Point3 tip{fit.tip.x, fit.tip.y, fit.tip.z};
    for (std::size_t g = 0; g < groups.size(); ++g) {
        const Point3 pivot =
            groups.size() == 1 || fit.pivots.size() == groups.size() ? fit.pivots[g] : Point3{};
        RestPoint rest;
        rest.pivot_mm = pivot + origin;
        rest.poses = static_cast<int>(groups[g].size());
        rest.first_frame = poses[groups[g].front()].frame;
        rest.last_frame = poses[groups[g].back()].frame;
        double rest_square = 0;
        for (std::size_t i : groups[g]) {
            const double r = distance(poses[i].tracker_from_tool * tip, pivot);
            out.residuals[i].residual_mm = r;
            out.residuals[i].inlier = true;
            out.residuals[i].rest = static_cast<int>(g);
            rest_square += r * r;
        }
        square_sum += rest_square;
        const auto n = static_cast<double>(groups[g].size());
        rest.rms_mm = std::sqrt(rest_square / n);
        const Matrix3& mean = fit.mean_rotation[g];
        if (out.determined) {
            // The tip's error and the mean position's are independent.
            Matrix3 c = mean * covariance * transpose(mean);
            for (int k = 0; k < 3; ++k) c(k, k) += widened * widened / n;
            rest.sigma_mm = root_of_diagonal(c);
        } else {
            rest.sigma_mm = {INFINITY, INFINITY, INFINITY};
        }
        if (groups[g].size() > groups[largest].size()) largest = g;
        out.rests.push_back(rest);
    }
    out.rms_mm = std::sqrt(square_sum / static_cast<double>(fit.poses));
    out.pivot_mm = out.rests[largest].pivot_mm;
    out.pivot_sigma_mm = out.rests[largest].sigma_mm;
    // Poses left out: how far they are from the nearest resting point.
    for (std::size_t i = 0; i < poses.size(); ++i) {
        if (out.residuals[i].inlier) continue;
        double nearest = INFINITY;
        for (const RestPoint& rest : out.rests) {
            nearest = std::min(nearest,
                               distance(poses[i].tracker_from_tool * tip + origin, rest.pivot_mm));
        }
        out.residuals[i].residual_mm = nearest;
    }

    if (!out.determined) return out;
    if (groups.size() > 1) {
        out.warnings.push_back(
            text("The tip rests on %zu points in turn (%d of %d poses); they were fitted "
                 "together with one tip.",
                 groups.size(), out.inliers, out.poses));
    } else if (out.inliers < out.poses) {
        const double share = 100.0 * (out.poses - out.inliers) / out.poses;
        out.warnings.push_back(
            text("%d of %d poses (%.0f %%) do not rest on the common point and are left "
                 "out%s.",
                 out.poses - out.inliers, out.poses, share,
                 share > 40 ? "; with so many the answer is doubtful: record again with "
                              "the tip held fast"
                            : ""));
    }
    if (out.poses < 10) {
        out.warnings.push_back(text("Only %d poses; take 30 or more.", out.poses));
    }
    if (norm(out.tip_mm) < 2 && out.swing.x > 0.05) {
        out.warnings.push_back(
            text("The tip lies only %.3f mm from the sensor; if positions are in metres "
                 "or inches, export them in mm.",
                 norm(out.tip_mm)));
    }
    // Inverse poses are a pivot recording too, with tip and pivot exchanged: only the lengths tell.
    const Point3 zero{};
    if (norm(out.tip_mm) > 500 && distance(out.pivot_mm, zero) < 0.5 * norm(out.tip_mm)) {
        out.warnings.push_back(text(
            "The tip lies %.0f mm from the sensor, farther than the pivot from the tracker; if "
            "these "
            "are inverse poses (the tracker seen from the tool), export the tool seen from the "
            "tracker.",
            norm(out.tip_mm)));
    }
    hint_at_conventions(poses, sigma, out);
    return out;
}

Vector3 fit_point_paper(std::span<const Pose> poses, Point3* pivot_mm) {
    LeastSquares system(6);
    for (const Pose& pose : poses) {
        const Rigid& t = pose.tracker_from_tool;
        const Vector3 dir = t.rotation.column(0), ori = t.rotation.column(1);
        const Vector3 third = cross(dir, ori);
        for (int r = 0; r < 3; ++r) {
            std::array<double, 6> row{0, 0, 0, -dir[r], -ori[r], -third[r]};
            row[static_cast<std::size_t>(r)] = 1;
            system.add(row.data(), t.translation[r]);
        }
    }
    const LeastSquaresFit fit = system.solve();
    if (pivot_mm) *pivot_mm = {fit.x[0], fit.x[1], fit.x[2]};
    return {fit.x[3], fit.x[4], fit.x[5]};
}

std::vector<Point3> tip_trace(std::span<const Pose> poses, Vector3 tip_mm) {
    std::vector<Point3> trace;
    trace.reserve(poses.size());
    for (const Pose& p : poses) {
        trace.push_back(p.tracker_from_tool * Point3{tip_mm.x, tip_mm.y, tip_mm.z});
    }
    return trace;
}

std::vector<RestPoint> find_rests(std::span<const Pose> poses,
                                  Vector3 tip_mm,
                                  const RestOptions& options) {
    std::vector<RestPoint> rests;
    const std::vector<Point3> trace = tip_trace(poses, tip_mm);
    for (const PoseGroup& run : calibrate::runs_at_rest(
             poses, tip_mm, options.radius_mm, static_cast<std::size_t>(options.min_poses))) {
        const auto n = static_cast<double>(run.size());
        Vector3 sum;
        for (std::size_t i : run) sum = sum + (trace[i] - trace[run[0]]);
        RestPoint rest;
        rest.pivot_mm = trace[run[0]] + sum / n;
        double square = 0;
        for (std::size_t i : run) {
            const Vector3 r = trace[i] - rest.pivot_mm;
            square += dot(r, r);
        }
        rest.rms_mm = std::sqrt(square / n);
        const double sigma = rest.rms_mm / std::sqrt(3 * n);
        rest.sigma_mm = {sigma, sigma, sigma};
        rest.first_frame = poses[run.front()].frame;
        rest.last_frame = poses[run.back()].frame;
        rest.poses = static_cast<int>(run.size());
        rests.push_back(rest);
    }
    return rests;
}

}  // namespace sonocase
