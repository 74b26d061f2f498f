// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/direction.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "formats/calibration/least_squares.h"
#include "formats/calibration/pivot.h"
#include "formats/calibration/pose_screen.h"
#include "formats/calibration/report_text.h"
#include "formats/calibration/statistics.h"

namespace sonocase {
namespace {

using namespace calibrate;

struct Line {
    Point3 point;
    Vector3 direction;
    double along = 0;   // standard deviation along the line
    double across = 0;  // standard deviation across it, per component
};

Line fit_line(const std::vector<Point3>& points, const std::vector<std::size_t>& chosen) {
    Line line;
    Vector3 sum;
    for (std::size_t i : chosen) sum = sum + (points[i] - points[chosen[0]]);
    const auto n = static_cast<double>(chosen.size());
    line.point = points[chosen[0]] + sum / n;
    LeastSquares spread(3);  // only its singular values and directions are wanted
    for (std::size_t i : chosen) {
        const Vector3 v = points[i] - line.point;
        const double row[3] = {v.x, v.y, v.z};
        spread.add(row, 0);
    }
    const LeastSquaresFit fit = spread.solve();
    line.direction = {fit.direction[0][0], fit.direction[0][1], fit.direction[0][2]};
    line.along = fit.singular[0] / std::sqrt(n);
    const double rest = fit.singular[1] * fit.singular[1] + fit.singular[2] * fit.singular[2];
    line.across = std::sqrt(rest / std::max(1.0, 2 * n - 4));
    return line;
}

double off_line(const Line& line, Point3 p) {
    return norm(cross(p - line.point, line.direction));
}

std::vector<std::size_t> straight_part(const std::vector<Point3>& points,
                                       const DirectionOptions& options) {
    std::vector<std::size_t> all(points.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    if (!options.reject_outliers || points.size() < 6) return all;
    const auto residuals = [&](const Line& line) {
        std::vector<double> r;
        r.reserve(points.size());
        for (const Point3& p : points) r.push_back(off_line(line, p));
        return r;
    };
    // Least median of squares over lines through two readings; used only if far better than the
    // plain fit.
    Line best = fit_line(points, all);
    double best_middle = 0.7 * median(residuals(best));
    RandomStream random(options.seed);
    for (int trial = 0; trial < options.trials; ++trial) {
        const std::size_t a = random.below(points.size()), b = random.below(points.size());
        const Vector3 v = points[b] - points[a];
        if (!(norm(v) > 1e-9)) continue;
        const Line line{points[a], normalized(v)};
        const double middle = median(residuals(line));
        if (middle < best_middle) {
            best_middle = middle;
            best = line;
        }
    }
    std::vector<std::size_t> kept;
    for (int round = 0; round < 20; ++round) {
        const std::vector<double> r = residuals(best);
        const double limit = options.outlier_sigmas * median(r) / kMedianLength2 + 1e-6;
        std::vector<std::size_t> next;
        for (std::size_t i = 0; i < r.size(); ++i) {
            if (r[i] <= limit) next.push_back(i);
        }
        if (next == kept || next.size() < 4) break;
        kept = std::move(next);
        best = fit_line(points, kept);
    }
    return kept.size() >= 4 ? kept : all;
}

// Points the line the way the sweep first went, which is that of its first stroke of a quarter of
// the whole length. Sets the length and whether later strokes went back.
void orient_line(const std::vector<Point3>& points,
                 const std::vector<std::size_t>& kept,
                 Line& line,
                 DirectionFit& out) {
    double low = INFINITY, high = -INFINITY;
    std::vector<double> along;
    for (std::size_t i : kept) {
        along.push_back(dot(points[i] - line.point, line.direction));
        low = std::min(low, along.back());
        high = std::max(high, along.back());
    }
    out.length_mm = high - low;
    double lowest = along[0], highest = along[0];
    int first = 0, turns = 0, way = 0;
    for (double s : along) {
        lowest = std::min(lowest, s);
        highest = std::max(highest, s);
        const int now = s - lowest > 0.25 * out.length_mm    ? 1
                        : highest - s > 0.25 * out.length_mm ? -1
                                                             : 0;
        if (now == 0) continue;
        if (first == 0) first = now;
        turns += way != 0 && now != way;
        way = now;
        lowest = highest = s;
    }
    if (first < 0) line.direction = -line.direction;
    out.back_and_forth = turns > 0;
}

// Sets the line's direction in the sensor's frame, averaged over the poses, and how far the tool
// turned about its mean orientation.
void project_into_sensor(const std::vector<Pose>& poses,
                         const std::vector<std::size_t>& kept,
                         const Line& line,
                         DirectionFit& out) {
    Matrix3 mean = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};
    Vector3 k;
    for (std::size_t i : kept) {
        const Matrix3& r = poses[i].tracker_from_tool.rotation;
        for (std::size_t m = 0; m < 9; ++m) mean.m[m] += r.m[m] / static_cast<double>(kept.size());
        k = k + transpose(r) * line.direction;
    }
    double turn = 0;
    if (determinant(mean) > 0.1) {
        const Matrix3 middle = nearest_rotation(mean);
        for (std::size_t i : kept) {
            const double a =
                rotation_angle(transpose(middle) * poses[i].tracker_from_tool.rotation);
            turn += a * a;
        }
        out.turn_rad = std::sqrt(turn / static_cast<double>(kept.size()));
    } else {
        out.turn_rad = kPi;
    }
    out.direction = normalized(k);
}

// Sets the distances from the line and their rms. Returns the correlation of successive distances,
// 0 if it could be chance.
double fill_residuals(const std::vector<Pose>& poses,
                      const std::vector<Point3>& points,
                      const std::vector<std::size_t>& kept,
                      const Line& line,
                      DirectionFit& out) {
    double square = 0, product = 0;
    Vector3 before;
    for (const Pose& p : poses)
        out.residuals.push_back({.frame = p.frame, .timestamp_s = p.timestamp_s});
    for (std::size_t i = 0; i < poses.size(); ++i)
        out.residuals[i].residual_mm = off_line(line, points[i]);
    for (std::size_t i : kept) {
        out.residuals[i].inlier = true;
        out.residuals[i].rest = 0;
        const Vector3 v = points[i] - line.point;
        const Vector3 r = v - dot(v, line.direction) * line.direction;
        square += dot(r, r);
        product += dot(before, r);
        before = r;
    }
    const auto n = static_cast<double>(kept.size());
    out.rms_mm = std::sqrt(square / n);
    double rho = square > 0 ? product / square : 0;
    rho = rho > 2 / std::sqrt(2 * n) ? std::min(rho, 0.98) : 0;
    return rho;
}

// Sets whether the path determines a direction, and warns of what is doubtful about it.
void judge_path(const Line& line, double rho, DirectionFit& out) {
    const auto n = static_cast<double>(out.inliers);
    if (out.length_mm < 1 || out.condition < 3) {
        out.problem =
            out.length_mm < 1
                ? text("the tool moved only %.2f mm; move it along the direction, 50 mm or more",
                       out.length_mm)
                : text(
                      "the path is not a straight line (%.1f mm along, %.1f mm rms across); move "
                      "the tool along a straight edge",
                      out.length_mm, out.rms_mm);
        return;
    }
    out.determined = true;
    out.sigma_rad = line.across / (line.along * std::sqrt(n)) * std::sqrt((1 + rho) / (1 - rho));
    if (out.length_mm < 20) {
        out.warnings.push_back(
            text("The path is only %.0f mm long; 50 mm or more give a steadier direction.",
                 out.length_mm));
    }
    if (out.turn_rad > 5 * kRadPerDeg) {
        out.warnings.push_back(
            text("The tool turned by %.1f degrees rms while it moved; hold its orientation, "
                 "or slide it along an edge.",
                 out.turn_rad / kRadPerDeg));
    }
    if (out.rms_mm > 0.05 * out.length_mm) {
        out.warnings.push_back(
            text("The path strays %.1f mm rms from a line of %.0f mm; slide the tool along "
                 "a straight edge.",
                 out.rms_mm, out.length_mm));
    }
    if (out.back_and_forth) {
        out.warnings.push_back(
            "The sweep goes back and forth; the direction is that of its first stroke: "
            "check it on the picture.");
    }
    if (out.inliers < out.poses) {
        out.warnings.push_back(text("%d of %d poses lie off the line and are left out.",
                                    out.poses - out.inliers, out.poses));
    }
}

}  // namespace

DirectionFit fit_direction(std::span<const Pose> readings, const DirectionOptions& options) {
    assert(options.outlier_sigmas > 3 && options.trials >= 1);
    DirectionFit out;
    out.sigma_rad = INFINITY;
    PoseScreen screen = screen_poses(readings);
    out.warnings = std::move(screen.warnings);
    const std::vector<Pose>& poses = screen.poses;
    out.poses = static_cast<int>(poses.size());
    if (poses.size() < 3) {
        out.problem = text(
            "%zu usable poses; at least 3 are needed and 30 or more are better: move the "
            "tool along the direction, 50 mm or more, without turning it",
            poses.size());
        return out;
    }
    const std::vector<Point3> points = tip_trace(poses, options.tip_mm);
    const std::vector<std::size_t> kept = straight_part(points, options);
    Line line = fit_line(points, kept);
    out.inliers = static_cast<int>(kept.size());
    orient_line(points, kept, line, out);
    project_into_sensor(poses, kept, line, out);
    const double rho = fill_residuals(poses, points, kept, line, out);
    out.condition = line.across > 0 ? line.along / line.across : INFINITY;
    judge_path(line, rho, out);
    return out;
}

Vector3 fit_direction_paper(std::span<const Pose> poses, double min_step_mm) {
    // Unit V_n = (K_d, K_p, K_3) (S_dir, S_ori, S_3)^T: with orthonormal S the least-squares
    // solution over all pairs is the mean of R_n^T V_n.
    Vector3 k;
    std::size_t from = 0;
    for (std::size_t i = 1; i < poses.size(); ++i) {
        const Vector3 step =
            poses[i].tracker_from_tool.translation - poses[from].tracker_from_tool.translation;
        if (norm(step) < min_step_mm) continue;
        k = k + transpose(poses[from].tracker_from_tool.rotation) * normalized(step);
        from = i;
    }
    return normalized(k);
}

ProbeFrame make_probe_frame(const DirectionFit& depth, const DirectionFit& lateral) {
    ProbeFrame out;
    const Vector3 z = depth.direction, x = lateral.direction;
    out.raw_angle_rad = std::atan2(norm(cross(z, x)), dot(z, x));
    if (!depth.determined || !lateral.determined) {
        out.problem = !depth.determined ? "depth sweep: " + depth.problem
                                        : "lateral sweep: " + lateral.problem;
        out.sigma_rad = INFINITY;
        return out;
    }
    const double error = out.raw_angle_rad - 90 * kRadPerDeg;  // > 0: the two lie too far apart
    if (std::abs(error) > 60 * kRadPerDeg) {
        out.problem = text(
            "the two sweeps are only %.0f degrees apart; one goes into the body, the other "
            "along the probe's face",
            std::min(out.raw_angle_rad, 180 * kRadPerDeg - out.raw_angle_rad) / kRadPerDeg);
        out.sigma_rad = INFINITY;
        return out;
    }
    const double vz = depth.sigma_rad * depth.sigma_rad, vx = lateral.sigma_rad * lateral.sigma_rad;
    const double share_z = vz + vx > 0 ? vz / (vz + vx) : 0.5;
    // About y = z x x, a positive turn carries z towards x.
    const Vector3 y = normalized(cross(z, x));
    const Vector3 z1 = normalized(rotation_about(y, share_z * error) * z);
    const Vector3 x1 = normalized(cross(y, z1));
    out.sensor_from_probe = nearest_rotation(Matrix3::from_columns(x1, y, z1));
    // The common error leaves each axis with the variance of the better-known combination.
    out.sigma_rad = std::sqrt(std::max(vz, vx));
    out.determined = true;
    if (std::abs(error) > 5 * kRadPerDeg) {
        out.warnings.push_back(
            text("The two sweeps make an angle of %.1f degrees instead of 90; hold the "
                 "probe straight and sweep along an edge.",
                 out.raw_angle_rad / kRadPerDeg));
    }
    return out;
}

}  // namespace sonocase
