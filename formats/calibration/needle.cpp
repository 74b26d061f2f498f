// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/needle.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/calibration/pivot.h"
#include "formats/calibration/pose_screen.h"
#include "formats/calibration/report_text.h"

namespace sonocase {
namespace {

using namespace calibrate;

constexpr const char* kSpinAlone =
    "A spin gives the axis but neither the tip nor which way it points; add a recording with the "
    "tip "
    "on a fixed point.";

struct AxisPoint {
    Vector3 at;
    Matrix3 weight;  // inverse covariance
    double depth_mm = 0;
};

// Inverse covariance of a pivot fit's tip: R^T R of the centred system over the variance.
Matrix3 weight_of(const std::vector<Pose>& poses, const PointFit& fit) {
    PivotSums sums;
    std::size_t at = 0;
    std::vector<Pose> used = screen_poses(poses).poses;
    for (const Pose& p : used) {
        if (fit.residuals[at++].inlier) sums.add(p.tracker_from_tool);
    }
    Matrix3 w = sums.normal();
    const double freedom = std::max(1.0, 3.0 * fit.inliers - 6);
    const double variance = fit.rms_mm * fit.rms_mm * fit.inliers / freedom *
                            (1 + fit.correlation) / (1 - fit.correlation);
    // Exact readings keep a finite weight: a standard deviation of a tenth of a micrometre.
    for (double& v : w.m) v /= std::max(variance, 1e-8);
    return w;
}

Vector3 as_vector(const std::array<double, kMaxUnknowns>& v) {
    return {v[0], v[1], v[2]};
}

double quadratic(Vector3 a, const Matrix3& w, Vector3 b) {
    return dot(a, w * b);
}

// The paper's axis: the principal component of the points, then the mean of the points minus their
// projections on it.
void paper_axis(const std::vector<AxisPoint>& points, NeedleFit& out) {
    const auto n = static_cast<double>(points.size());
    Vector3 mean;
    for (const AxisPoint& p : points) mean = mean + p.at / n;
    LeastSquares spread(3);
    for (const AxisPoint& p : points) {
        const Vector3 v = p.at - mean;
        const double row[3] = {v.x, v.y, v.z};
        spread.add(row, 0);
    }
    const LeastSquaresFit fit = spread.solve();
    out.paper_direction = as_vector(fit.direction[0]);
    out.paper_point_mm = {};
    for (const AxisPoint& p : points) {
        out.paper_point_mm =
            out.paper_point_mm + (p.at - dot(p.at, out.paper_direction) * out.paper_direction) / n;
    }
    out.condition = fit.singular[1] > 0 ? fit.singular[0] / fit.singular[1] : INFINITY;
}

// A line, with the standard deviations of its direction and offset.
struct WeightedLine {
    Vector3 direction, at;
    double direction_sigma = 0;
    double offset_sigma = 0;  // across, at the centroid
    double chi_square = 0;
    std::vector<double> along;  // position of each point along the line
};

// Fits a line through points of known covariance: Gauss-Newton over two offsets and two tilts; the
// position of each point along the line is eliminated.
WeightedLine weighted_line(const std::vector<AxisPoint>& points, Vector3 direction) {
    WeightedLine line;
    line.direction = direction;
    for (const AxisPoint& p : points) line.at = line.at + p.at / static_cast<double>(points.size());
    line.along.resize(points.size());
    for (int round = 0; round < 12; ++round) {
        const Vector3 d = line.direction, e1 = any_perpendicular(d), e2 = cross(d, e1);
        LeastSquares system(4);
        for (std::size_t k = 0; k < points.size(); ++k) {
            const Matrix3& w = points[k].weight;
            const Vector3 r = points[k].at - line.at;
            const double dd = quadratic(d, w, d);
            const double s = quadratic(d, w, r) / dd;
            line.along[k] = s;
            // Weight across the line once the position along it is eliminated.
            const double w1 = quadratic(d, w, e1), w2 = quadratic(d, w, e2);
            const double b11 = quadratic(e1, w, e1) - w1 * w1 / dd;
            const double b12 = quadratic(e1, w, e2) - w1 * w2 / dd;
            const double b22 = quadratic(e2, w, e2) - w2 * w2 / dd;
            const double l11 = std::sqrt(std::max(b11, 1e-300));
            const double l21 = b12 / l11;
            const double l22 = std::sqrt(std::max(b22 - l21 * l21, 1e-300));
            const double u1 = dot(r, e1), u2 = dot(r, e2);
            const double first[4] = {l11, l21, s * l11, s * l21};
            const double second[4] = {0, l22, 0, s * l22};
            system.add(first, l11 * u1 + l21 * u2);
            system.add(second, l22 * u2);
        }
        const LeastSquaresFit fit = system.solve();
        line.at = line.at + fit.x[0] * e1 + fit.x[1] * e2;
        line.direction = normalized(d + fit.x[2] * e1 + fit.x[3] * e2);
        line.chi_square = fit.residual_sum;
        line.direction_sigma = std::sqrt(0.5 * (fit.covariance(2, 2) + fit.covariance(3, 3)));
        line.offset_sigma = std::sqrt(0.5 * (fit.covariance(0, 0) + fit.covariance(1, 1)));
        if (std::hypot(fit.x[2], fit.x[3]) < 1e-14) break;
    }
    return line;
}

// Orients the line and sets the tip on it: by the measured depths, or else at the point farthest
// from the sensor.
void place_tip(const std::vector<AxisPoint>& points,
               const NeedleOptions& options,
               WeightedLine& line,
               NeedleFit& out) {
    double reach = -INFINITY, along_sigma = 0;
    if (!options.depths_mm.empty()) {
        // Each point k puts the tip at s_k + depth_k. Regress s on depth first: the slope is -1.
        double ms = 0, md = 0, sd = 0, dd = 0;
        const auto n = static_cast<double>(points.size());
        for (std::size_t k = 0; k < points.size(); ++k) {
            ms += line.along[k] / n;
            md += points[k].depth_mm / n;
        }
        for (std::size_t k = 0; k < points.size(); ++k) {
            sd += (line.along[k] - ms) * (points[k].depth_mm - md);
            dd += (points[k].depth_mm - md) * (points[k].depth_mm - md);
        }
        double slope = dd > 0 ? sd / dd : -1;
        if (slope > 0) {
            line.direction = -line.direction;
            for (double& s : line.along) s = -s;
            ms = -ms;
            slope = -slope;
        }
        reach = ms + md;
        double scatter = 0;
        for (std::size_t k = 0; k < points.size(); ++k) {
            const double e = line.along[k] + points[k].depth_mm - reach;
            scatter += e * e;
        }
        along_sigma = points.size() > 1 ? std::sqrt(scatter / (n - 1) / n) : 0;
        out.tip_measured = true;
        if (dd > 0 && std::abs(slope + 1) > 0.1) {
            out.warnings.push_back(
                text("The depths given differ from the motion of the pinhole along the "
                     "needle by a factor of %.2f; give them in mm, from hole to tip.",
                     -slope));
        } else if (std::sqrt(scatter / n) > 1) {
            out.warnings.push_back(
                text("The depths given scatter by %.1f mm rms about the fit; measure them "
                     "again.",
                     std::sqrt(scatter / n)));
        }
    } else {
        if (dot(line.direction, line.at) < 0) {
            line.direction = -line.direction;
            for (double& s : line.along) s = -s;
        }
        reach = *std::max_element(line.along.begin(), line.along.end());
        out.warnings.push_back(
            "No depths are given: the point that lies farthest from the sensor is taken "
            "as the tip; give the distance from hole to tip of each recording, or make "
            "one with the tip itself on a fixed point.");
    }
    out.direction = line.direction;
    out.tip_mm = line.at + reach * line.direction;
    out.axis_point_mm = line.at - dot(line.at, line.direction) * line.direction;
    for (int c = 0; c < 3; ++c) {
        const double a = line.direction[c] * along_sigma;
        const double across = std::hypot(line.offset_sigma, reach * line.direction_sigma);
        out.tip_sigma_mm[c] = std::hypot(
            a, across * std::sqrt(std::max(0.0, 1 - line.direction[c] * line.direction[c])));
    }
    if (dot(out.paper_direction, out.direction) < 0) out.paper_direction = -out.paper_direction;
}

}  // namespace

Rigid NeedleFit::sensor_from_needle() const {
    const Vector3 x = any_perpendicular(direction);
    return {Matrix3::from_columns(x, cross(direction, x), direction), tip_mm};
}

NeedleFit fit_needle(std::span<const std::vector<Pose>> recordings, const NeedleOptions& options) {
    NeedleFit out;
    out.direction_sigma_rad = INFINITY;
    out.tip_sigma_mm = {INFINITY, INFINITY, INFINITY};
    std::vector<AxisPoint> points;
    for (std::size_t k = 0; k < recordings.size(); ++k) {
        PointFit fit = fit_point(recordings[k], options.point);
        out.poses += fit.poses;
        const std::string which = text("recording %zu: ", k + 1);
        for (const std::string& w : fit.warnings) out.warnings.push_back(which + w);
        if (fit.determined) {
            out.inliers += fit.inliers;
            AxisPoint p{fit.tip_mm, weight_of(recordings[k], fit), 0};
            if (k < options.depths_mm.size()) p.depth_mm = options.depths_mm[k];
            points.push_back(p);
        } else {
            out.warnings.push_back(which + fit.problem + "; left out.");
        }
        out.points.push_back(std::move(fit));
    }
    if (!options.depths_mm.empty() && options.depths_mm.size() != recordings.size()) {
        out.problem = text("%zu depths for %zu recordings; give one per recording",
                           options.depths_mm.size(), recordings.size());
        return out;
    }
    if (points.size() < 2) {
        out.problem = text(
            "%zu usable pinhole depth%s; at least 2 are needed and 5 are better: push the "
            "needle further in and tilt it again",
            points.size(), points.size() == 1 ? "" : "s");
        return out;
    }
    paper_axis(points, out);
    double far = 0;
    for (const AxisPoint& a : points) {
        for (const AxisPoint& b : points) far = std::max(far, norm(a.at - b.at));
    }
    if (far < 5) {
        out.problem =
            text("the pinhole depths differ by %.1f mm only; spread them over 20 mm or more", far);
        return out;
    }
    WeightedLine line = weighted_line(points, out.paper_direction);
    // If points lie farther from the line than their own sigmas allow, the needle bent or slipped.
    const double freedom = 2.0 * static_cast<double>(points.size()) - 4;
    const double excess = freedom > 0 ? line.chi_square / freedom : 0;
    double square = 0;
    for (const AxisPoint& p : points) {
        const Vector3 v = cross(p.at - line.at, line.direction);
        square += dot(v, v);
    }
    out.rms_mm = std::sqrt(square / static_cast<double>(points.size()));
    if (excess > 1) {
        line.direction_sigma *= std::sqrt(excess);
        line.offset_sigma *= std::sqrt(excess);
    }
    place_tip(points, options, line, out);
    out.direction_sigma_rad = line.direction_sigma;
    out.determined = true;
    if (excess > 9 && out.rms_mm > 0.3) {
        out.warnings.push_back(
            text("The depths do not lie on one line (%.1f mm rms); the needle bent or the "
                 "sensor slipped: record again with less force.",
                 out.rms_mm));
    }
    if (points.size() < 4) {
        out.warnings.push_back(
            text("Only %zu depths; 5 over 50 mm or more are better.", points.size()));
    }
    if (line.direction_sigma > 0.5 * kRadPerDeg) {
        out.warnings.push_back(
            text("The direction is known to %.1f degrees only; spread the depths further "
                 "(now %.0f mm) and tilt more at each.",
                 line.direction_sigma / kRadPerDeg, far));
    }
    return out;
}

NeedleFit fit_needle_spin(std::span<const Pose> readings) {
    NeedleFit out;
    out.direction_sigma_rad = INFINITY;
    out.tip_sigma_mm = {INFINITY, INFINITY, INFINITY};
    PoseScreen screen = screen_poses(readings);
    out.warnings = std::move(screen.warnings);
    const std::vector<Pose>& poses = screen.poses;
    out.poses = out.inliers = static_cast<int>(poses.size());
    if (poses.size() < 3) {
        out.problem = text(
            "%zu usable poses; at least 3 are needed and 30 or more are better: spin the "
            "needle in a groove",
            poses.size());
        return out;
    }
    const PoseGroup all = all_poses(poses.size());
    const double root_n = std::sqrt(static_cast<double>(poses.size()));
    const PivotSolution free = solve_pivots(poses, std::span(&all, 1));
    const double s0 = free.fit.singular[0] / root_n, s1 = free.fit.singular[1] / root_n,
                 s2 = free.fit.singular[2] / root_n;
    if (s1 < 5 * kRadPerDeg) {
        out.problem = text("the needle spun by %.1f degrees rms only; spin it half a turn or more",
                           s0 / kRadPerDeg);
        return out;
    }
    if (s2 > 0.3 * s1) {
        out.problem =
            "the needle was tilted while it spun, so that no axis stays fixed; spin it in a "
            "groove, or use the recording as a pinhole depth";
        return out;
    }
    // Solves without the axis itself, because the position along it is undetermined.
    const PivotSolution across = solve_pivots(poses, std::span(&all, 1), 0.999 * s1 / s0);
    out.direction = as_vector(free.fit.direction[2]);
    out.axis_point_mm = across.tip - dot(across.tip, out.direction) * out.direction;
    out.condition = s0 / s1;
    out.rms_mm = std::sqrt(across.residual_sum / static_cast<double>(poses.size()));
    out.direction_sigma_rad = s2 / (s1 * root_n);
    out.tip_mm = out.axis_point_mm;
    out.paper_direction = out.direction;
    out.paper_point_mm = out.axis_point_mm;
    const double sigma = out.rms_mm / (std::sqrt(3.0) * across.fit.singular[1]);
    out.tip_sigma_mm = {INFINITY, INFINITY, INFINITY};
    for (int c = 0; c < 3; ++c) {
        if (std::abs(out.direction[c]) < 1e-6) out.tip_sigma_mm[c] = sigma;
    }
    out.determined = true;
    if (s2 > 0.02) {
        out.warnings.push_back(
            text("The axis tilted by %.1f degrees rms while the needle spun; hold it in a "
                 "groove.",
                 s2 / kRadPerDeg));
    }
    out.warnings.push_back(kSpinAlone);
    return out;
}

NeedleFit join_pivot_and_spin(const PointFit& pivot, const NeedleFit& spin) {
    NeedleFit out = spin;
    out.warnings = pivot.warnings;
    for (const std::string& warning : spin.warnings) {
        if (warning != kSpinAlone) out.warnings.push_back(warning);
    }
    out.points = {pivot};
    out.poses = pivot.poses + spin.poses;
    out.inliers = pivot.inliers + spin.inliers;
    out.rms_mm = pivot.rms_mm;
    out.tip_mm = pivot.tip_mm;
    out.tip_sigma_mm = pivot.sigma_mm;
    out.tip_measured = true;
    out.determined = false;
    if (!pivot.determined) {
        out.problem = "the pivot has no answer: " + pivot.problem;
        return out;
    }
    if (!spin.determined) {
        out.problem = "the spin has no answer: " + spin.problem;
        return out;
    }
    const double along = dot(pivot.tip_mm, spin.direction);
    if (along < 0) out.direction = -out.direction;
    const double sigma = std::max({pivot.sigma_mm.x, pivot.sigma_mm.y, pivot.sigma_mm.z});
    if (!(std::abs(along) > std::max(5.0, 3 * sigma))) {
        out.problem = text(
            "the tip lies only %.1f mm from the sensor along the needle, so that its sign is not "
            "known; use pinholes at several depths",
            std::abs(along));
        return out;
    }
    out.axis_point_mm = pivot.tip_mm - along * spin.direction;
    out.paper_direction = out.direction;
    out.paper_point_mm = out.axis_point_mm;
    out.determined = true;
    const double off = norm(cross(pivot.tip_mm - spin.axis_point_mm, spin.direction));
    const double across = std::hypot(sigma, std::abs(along) * spin.direction_sigma_rad);
    if (off > std::max(1.0, 3 * across)) {
        out.warnings.push_back(
            text("The tip lies %.1f mm beside the axis that the spin found; the needle is bent, or "
                 "the sensor slipped between the two: record both again.",
                 off));
    }
    return out;
}

NeedleAgreement compare(const NeedleFit& pinholes, const NeedleFit& spin) {
    NeedleAgreement out;
    if (!pinholes.determined || !spin.determined) {
        out.sentence =
            "One of the two needle calibrations has no answer, so they cannot be compared.";
        return out;
    }
    const Vector3 a = pinholes.direction;
    const Vector3 b = dot(a, spin.direction) < 0 ? -spin.direction : spin.direction;
    out.angle_rad = std::atan2(norm(cross(a, b)), dot(a, b));
    out.distance_mm = norm(cross(pinholes.tip_mm - spin.axis_point_mm, b));
    const double sigma = std::hypot(pinholes.direction_sigma_rad, spin.direction_sigma_rad);
    const double reach = norm(pinholes.tip_mm - spin.axis_point_mm);
    const double across = std::hypot(std::hypot(pinholes.tip_sigma_mm.x, pinholes.tip_sigma_mm.y),
                                     reach * spin.direction_sigma_rad);
    out.agree = out.angle_rad <= std::max(1 * kRadPerDeg, 3 * sigma) &&
                out.distance_mm <= std::max(1.0, 3 * across);
    out.sentence =
        text(out.agree ? "Pinholes and spin agree: %.2f degrees, %.2f mm at the tip."
                       : "Pinholes and spin disagree by %.2f degrees and %.2f mm at the tip; the "
                         "needle bent or the sensor slipped between them: record both again.",
             out.angle_rad / kRadPerDeg, out.distance_mm);
    return out;
}

}  // namespace sonocase
