// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/point.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <span>

#include "formats/base/constants.h"
#include "formats/calibration/pivot.h"
#include "formats/calibration/pose_screen.h"
#include "formats/calibration/report_text.h"

namespace sonocase {
namespace {

using namespace calibrate;

// Warns if transposed rotations explain the recording far better: the export wrote them by columns.
void warn_of_transposed_rotations(std::span<const Pose> poses, double sigma, PointFit& out) {
    if (poses.size() < 10 || sigma < 2) return;
    std::vector<Pose> turned(poses.begin(), poses.end());
    for (Pose& p : turned) p.tracker_from_tool.rotation = transpose(p.tracker_from_tool.rotation);
    const PoseGroup all = all_poses(poses.size());
    const double plain = residual_sigma_mm(solve_pivots(poses, std::span(&all, 1)), 1);
    if (residual_sigma_mm(solve_pivots(turned, std::span(&all, 1)), 1) < 0.25 * plain) {
        out.warnings.push_back(
            "The readings fit far better with every rotation transposed; the export "
            "writes rotations column by column: write them row by row.");
    }
}

void warn_of_left_out_poses(PointFit& out) {
    if (out.rests.size() > 1) {
        out.warnings.push_back(
            text("The tip rests on %zu points in turn (%d of %d poses); they were fitted "
                 "together with one tip.",
                 out.rests.size(), out.inliers, out.poses));
        return;
    }
    if (out.inliers == out.poses) return;
    const double share = 100.0 * (out.poses - out.inliers) / out.poses;
    std::string consequence;
    if (share > 40) {
        consequence = "; with so many the answer is doubtful: record again with the tip held fast";
    } else if (out.left_out_shift_mm > out.left_out_sigma_mm) {
        consequence = text(
            "; with them the tip would lie %.2g mm away, more than one standard deviation (%.2g "
            "mm): check those poses on the picture, or record 100 poses or more",
            out.left_out_shift_mm, out.left_out_sigma_mm);
    }
    out.warnings.push_back(
        text("%d of %d poses (%.0f %%) do not rest on the common point and are left out%s.",
             out.poses - out.inliers, out.poses, share, consequence.c_str()));
}

// Warns of positions in other units and of inverse poses, which both give a plausible fit.
void warn_of_units_and_inverse_poses(PointFit& out) {
    if (norm(out.tip_mm) < 2 && out.swing.x > 0.05) {
        out.warnings.push_back(
            text("The tip lies only %.3f mm from the sensor; if positions are in metres "
                 "or inches, export them in mm.",
                 norm(out.tip_mm)));
    }
    // Inverse poses are a pivot recording too, with tip and pivot exchanged: only the lengths
    // differ.
    const Point3 zero{};
    if (norm(out.tip_mm) > 500 && distance(out.pivot_mm, zero) < 0.5 * norm(out.tip_mm)) {
        out.warnings.push_back(text(
            "The tip lies %.0f mm from the sensor, farther than the pivot from the tracker; if "
            "these are inverse poses (the tracker seen from the tool), export the tool seen from "
            "the tracker.",
            norm(out.tip_mm)));
    }
}

// Sets out.determined if the motion determines the tip, out.problem if it does not. Warns of a weak
// direction and of large residuals. sigma: of one coordinate of the residuals, mm; widest: the
// largest swing; poses: number of usable ones.
void judge_motion(double sigma, double widest, std::size_t poses, PointFit& out) {
    // A resting tracker shows 0.2 degrees rms; a swing below a two-hundredth of the largest swing
    // is noise of the latter.
    constexpr double kStill = 0.2 * kRadPerDeg, kShare = 0.005;
    if (poses < 3) {
        out.problem = text(
            "%zu usable pose%s; at least 3 are needed and 30 or more are better: rest the "
            "tip on a fixed point and tilt the tool every way",
            poses, poses == 1 ? "" : "s");
        return;
    }
    if (widest < kStill) {
        out.problem = text(
            "the sensor stood still (it turned by %.2f degrees), so the tip cannot be "
            "found; keep the tip on a fixed point and tilt the tool 30 degrees or "
            "more every way",
            widest / kRadPerDeg);
        return;
    }
    const double smallest = out.swing.z;
    if (smallest < 0.5 * kStill || smallest < kShare * out.swing.x) {
        out.problem =
            "rotation so far is about one axis, " + axis_text(out.weak_axis) +
            " of the sensor, and the tip is undetermined along it; tilt the tool sideways as "
            "well, about another axis";
        return;
    }
    out.determined = true;
    if (out.weak_sigma_mm > 0.5 || smallest < 3 * kRadPerDeg) {
        out.warnings.push_back(text(
            "The tip is known least along %s of the sensor: one standard deviation is %.2g mm, the "
            "tool swung only %.1f degrees rms across it; tilt it further, at right angles to that "
            "axis.",
            axis_text(out.weak_axis).c_str(), out.weak_sigma_mm,
            std::asin(std::min(1.0, smallest)) / kRadPerDeg));
    }
    if (sigma > 2) {
        out.warnings.push_back(
            text("Residuals are large (%.1f mm rms); the tip slid on its resting point, "
                 "the sensor is loose, or metal disturbs the tracker: fix that and "
                 "record again.",
                 sigma));
    }
}

// Warns of what is doubtful about an answer that the motion determines: poses left out, too few
// poses, units and conventions of the export. Poses screened; all other fields of `out` are set.
void warn_of_doubtful_answer(std::span<const Pose> poses, double sigma, PointFit& out) {
    warn_of_left_out_poses(out);
    if (out.poses < 10) {
        out.warnings.push_back(text("Only %d poses; take 30 or more.", out.poses));
    }
    warn_of_units_and_inverse_poses(out);
    warn_of_transposed_rotations(poses, sigma, out);
}

PointFit too_few_poses(PoseScreen screen) {
    PointFit out;
    out.warnings = std::move(screen.warnings);
    out.poses = static_cast<int>(screen.poses.size());
    out.sigma_mm = out.pivot_sigma_mm = {INFINITY, INFINITY, INFINITY};
    out.condition = out.weak_sigma_mm = INFINITY;
    judge_motion(0, 0, screen.poses.size(), out);
    if (screen.poses.size() == 2) {
        out.problem =
            "2 usable poses leave the tip open along the axis of the turn between them; at "
            "least 3 are needed and 30 or more are better: tilt the tool every way";
    }
    return out;
}

// Moves the positions to their mean, so that a far origin costs no digits; returns the mean.
Vector3 centre_positions(std::vector<Pose>& poses) {
    Vector3 origin;
    const Vector3 first = poses[0].tracker_from_tool.translation;
    for (const Pose& p : poses) {
        origin =
            origin + (p.tracker_from_tool.translation - first) / static_cast<double>(poses.size());
    }
    origin = first + origin;
    for (Pose& p : poses)
        p.tracker_from_tool.translation = p.tracker_from_tool.translation - origin;
    return origin;
}

// Correlation between residual vectors of successive poses in a group; 0 if within chance.
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

// Sets how well the poses determine the tip: swing, weakest direction, correlation, condition.
// Returns the standard deviation of one coordinate of the residuals, widened by their correlation.
double describe_motion(std::span<const Pose> poses,
                       const PivotSolution& fit,
                       const std::vector<PoseGroup>& groups,
                       double sigma,
                       PointFit& out) {
    const double root_n = std::sqrt(static_cast<double>(fit.poses));
    for (int k = 0; k < 3; ++k) {
        out.swing[k] = fit.fit.singular[k] / root_n;
    }
    out.weak_axis = {fit.fit.direction[2][0], fit.fit.direction[2][1], fit.fit.direction[2][2]};
    const double correlation = residual_correlation(poses, fit, groups);
    // Successive readings that share their error count for less than their number.
    const double widened = sigma * std::sqrt((1 + correlation) / (1 - correlation));
    out.correlation = correlation;
    out.weak_sigma_mm = widened / fit.fit.singular[2];
    // Singular values of the whole system are sqrt(N (1 +- s)), s those of the mean rotation;
    // written with the swing, 1 - s has no cancellation.
    const double smallest = out.swing.z;
    out.condition = (1 + std::sqrt(std::max(0.0, 1 - smallest * smallest))) / smallest;
    return widened;
}

// Solves again without the undetermined directions, so that noise does not fill them.
void solve_without_open_directions(std::span<const Pose> poses,
                                   const std::vector<PoseGroup>& groups,
                                   PivotSolution& fit,
                                   PointFit& out) {
    const double open = std::max(0.1 * kRadPerDeg, 0.005 * out.swing.x) * 1.0000001;
    fit = solve_pivots(poses, groups, std::min(0.5, open / std::max(out.swing.x, 1e-300)));
    out.weak_sigma_mm = out.condition = INFINITY;
    if (out.swing.x < 0.2 * kRadPerDeg) {
        fit.tip = {0, 0, 0};
        for (int k = 0; k < 3; ++k) fit.fit.singular[k] = 0;
        fit.fit.rank = 0;
    }
}

// Sets the resting point of each group and the residual of each pose; returns the residuals' sum of
// squares.
double fill_rests(std::span<const Pose> poses,
                  const std::vector<PoseGroup>& groups,
                  const PivotSolution& fit,
                  const Matrix3& covariance,
                  double widened,
                  Vector3 origin,
                  PointFit& out) {
    double square_sum = 0;
    const Point3 tip{fit.tip.x, fit.tip.y, fit.tip.z};
    for (std::size_t g = 0; g < groups.size(); ++g) {
        const Point3 pivot = fit.pivots[g];
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
        out.rests.push_back(rest);
    }
    return square_sum;
}

// Sets the residual of each pose left out to its distance from the nearest resting point.
void fill_residuals_of_left_out(std::span<const Pose> poses, Vector3 origin, PointFit& out) {
    const Point3 tip{out.tip_mm.x, out.tip_mm.y, out.tip_mm.z};
    for (std::size_t i = 0; i < poses.size(); ++i) {
        if (out.residuals[i].inlier) continue;
        double nearest = INFINITY;
        for (const RestPoint& rest : out.rests) {
            nearest = std::min(nearest,
                               distance(poses[i].tracker_from_tool * tip + origin, rest.pivot_mm));
        }
        out.residuals[i].residual_mm = nearest;
    }
}

// Sets how far the tip moves if no pose is left out, and its standard deviation in that direction.
void measure_left_out_shift(std::span<const Pose> poses, const Matrix3& covariance, PointFit& out) {
    if (out.rests.size() > 1) return;  // the poses between two rests do not belong to a pivot
    out.left_out_shift_mm = 0;
    if (out.inliers == out.poses) return;
    const PoseGroup all = all_poses(poses.size());
    const Vector3 shift = solve_pivots(poses, std::span(&all, 1)).tip - out.tip_mm;
    out.left_out_shift_mm = norm(shift);
    if (!(out.left_out_shift_mm > 0)) return;
    const Vector3 way = shift / out.left_out_shift_mm;
    out.left_out_sigma_mm = std::sqrt(std::max(0.0, dot(way, covariance * way)));
}

}  // namespace

PointFit fit_point(std::span<const Pose> readings, const PointOptions& options) {
    assert(options.outlier_sigmas > 3 && options.trials >= 1);
    PoseScreen screen = screen_poses(readings);
    if (screen.poses.size() < 3) return too_few_poses(std::move(screen));
    PointFit out;
    out.warnings = std::move(screen.warnings);
    std::vector<Pose> poses = std::move(screen.poses);
    out.poses = static_cast<int>(poses.size());
    const Vector3 origin = centre_positions(poses);

    const std::vector<PoseGroup> groups = resting_poses(poses, options);
    PivotSolution fit = solve_pivots(poses, groups);
    const double sigma = residual_sigma_mm(fit, groups.size());
    const double widened = describe_motion(poses, fit, groups, sigma, out);
    judge_motion(sigma, out.swing.x, poses.size(), out);
    if (!out.determined) solve_without_open_directions(poses, groups, fit, out);

    out.tip_mm = fit.tip;
    out.d1_mm = fit.tip.x;
    out.d2_mm = std::hypot(fit.tip.y, fit.tip.z);
    out.theta_rad = std::atan2(fit.tip.z, fit.tip.y);
    const Matrix3 covariance = tip_covariance(fit.fit, widened * widened);
    out.sigma_mm = root_of_diagonal(covariance);
    out.inliers = static_cast<int>(fit.poses);

    out.residuals.reserve(poses.size());
    for (const Pose& p : poses)
        out.residuals.push_back({.frame = p.frame, .timestamp_s = p.timestamp_s});
    const double square_sum = fill_rests(poses, groups, fit, covariance, widened, origin, out);
    fill_residuals_of_left_out(poses, origin, out);
    out.rms_mm = std::sqrt(square_sum / static_cast<double>(fit.poses));
    const auto largest =
        std::max_element(out.rests.begin(), out.rests.end(),
                         [](const RestPoint& a, const RestPoint& b) { return a.poses < b.poses; });
    out.pivot_mm = largest->pivot_mm;
    out.pivot_sigma_mm = largest->sigma_mm;
    if (!out.determined) return out;
    measure_left_out_shift(poses, covariance, out);
    warn_of_doubtful_answer(poses, sigma, out);
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
            row[r] = 1;
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
    for (const PoseGroup& run : runs_at_rest(poses, tip_mm, options.radius_mm,
                                             static_cast<std::size_t>(options.min_poses))) {
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

std::string misread_poses(std::span<const Pose> poses,
                          const PointFit& fit,
                          const PointOptions& options) {
    constexpr double kPoorMm = 2, kFarMm = 500;
    // A pivot of inverted poses is one too: tip and resting point change places.
    if (fit.determined && norm(fit.tip_mm) > kFarMm &&
        norm(fit.pivot_mm - Point3{}) < norm(fit.tip_mm) / 2)
        return "the tip would lie " + calibrate::text("%.0f", norm(fit.tip_mm)) +
               " mm from the sensor: the poses map the tracker to the tool; record the tool to the "
               "tracker";
    const bool most = 2 * fit.inliers > fit.poses;
    if (fit.determined && most && fit.rms_mm <= kPoorMm) return {};
    const auto quaternion_shifted = [](const Rigid& p) {
        const Quaternion q = quaternion_from_rotation(p.rotation);
        return Rigid{rotation_from_quaternion({q.z, q.w, q.x, q.y}), p.translation};
    };
    const struct {
        const char* sentence;
        Rigid (*turned)(const Rigid&);
    } kReadings[] = {
        {"the rotations fit if rows and columns are exchanged: they were written column by column; "
         "write them row by row",
         [](const Rigid& p) {
             return Rigid{transpose(p.rotation), p.translation};
         }},
        {"the poses fit if they are inverted: they map the tracker to the tool; record the tool to "
         "the tracker",
         [](const Rigid& p) { return inverse(p); }},
        {"the rotations fit if the quaternion's last number is the scalar: name the columns in the "
         "order in which they are, as in qx,qy,qz,qw",
         quaternion_shifted}};
    for (const auto& reading : kReadings) {
        std::vector<Pose> other(poses.begin(), poses.end());
        for (Pose& pose : other) {
            if (orthonormality_error(pose.tracker_from_tool.rotation) < 1e-2)
                pose.tracker_from_tool = reading.turned(pose.tracker_from_tool);
        }
        const PointFit again = fit_point(other, options);
        const bool whole = 2 * again.inliers > again.poses;
        if (again.determined && whole && again.rms_mm <= kPoorMm &&
            (!fit.determined || !most || again.rms_mm < fit.rms_mm / 3))
            return reading.sentence;
    }
    return {};
}

}  // namespace sonocase
