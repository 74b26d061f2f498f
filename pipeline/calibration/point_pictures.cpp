// SPDX-License-Identifier: Apache-2.0

// Pictures of the point calibration: residuals, their histogram, and how the tool was tilted.
#include <algorithm>
#include <cmath>

#include "formats/calibration/pose_screen.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/chart_parts.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;

Series ring(double radius, double cx = 0, double cy = 0) {
    Series s = stroke("", kGuide, 1);
    for (int k = 0; k <= 72; ++k) {
        s.x.push_back(cx + radius * std::cos(2 * kPi * k / 72));
        s.y.push_back(cy + radius * std::sin(2 * kPi * k / 72));
    }
    return s;
}

Chart histogram(std::span<const PoseResidual> residuals) {
    Chart chart{
        "Residuals of the readings used", "residual [mm]", "readings", false, false, {}, false};
    std::vector<double> values;
    for (const PoseResidual& r : residuals) {
        if (r.inlier) values.push_back(r.residual_mm);
    }
    if (values.empty()) return chart;
    const double top = std::max(*std::max_element(values.begin(), values.end()), 1e-9);
    constexpr int kBins = 30;
    std::vector<int> count(kBins, 0);
    for (double v : values) {
        ++count[static_cast<std::size_t>(std::min(kBins - 1, static_cast<int>(v / top * kBins)))];
    }
    Series steps = stroke("", kUsed, 2);
    for (int k = 0; k < kBins; ++k) {
        for (int side = 0; side < 2; ++side) {
            steps.x.push_back(top * (k + side) / kBins);
            steps.y.push_back(count[static_cast<std::size_t>(k)]);
        }
    }
    chart.series = {steps};
    return chart;
}

// How the tool was held: the tilt of its long axis (towards the tip) from the mean in two
// directions, and the twist about that axis.
std::vector<Chart> coverage(std::span<const Pose> poses,
                            Vector3 tip,
                            std::span<const PoseResidual> residuals) {
    Chart tilt{"Tilt of the tool about its mean",
               "tilt [degrees]",
               "tilt across [degrees]",
               false,
               false,
               {},
               true};
    Chart twist{
        "Twist about the tool's axis", "reading", "twist [degrees]", false, false, {}, false};
    if (poses.empty()) return {tilt, twist};
    const Vector3 axis = norm(tip) > 1e-6 ? normalized(tip) : Vector3{0, 0, 1};
    const Vector3 side = any_perpendicular(axis);
    Vector3 mean;
    for (const Pose& p : poses) mean = mean + p.tracker_from_tool.rotation * axis;
    mean = norm(mean) > 1e-9 ? normalized(mean) : Vector3{0, 0, 1};
    const Vector3 u = any_perpendicular(mean), v = cross(mean, u);
    Series used = marks("used", kUsed, 4), out = marks("left out", kLeftOut, 5),
           turned = marks("", kUsed, 4);
    out.look = SeriesLook::crosses;
    double widest = 5;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        const Matrix3& r = poses[i].tracker_from_tool.rotation;
        const Vector3 a = r * axis;
        const double angle = std::atan2(norm(cross(mean, a)), dot(mean, a)) * 180 / kPi;
        const double x = dot(a, u), y = dot(a, v), across = std::hypot(x, y);
        const bool inlier = i >= residuals.size() || residuals[i].inlier;
        Series& s = inlier ? used : out;
        s.x.push_back(across > 0 ? angle * x / across : 0);
        s.y.push_back(across > 0 ? angle * y / across : 0);
        if (!inlier) continue;
        widest = std::max(widest, angle);
        // Twist: the side axis after the shortest rotation that undoes the tilt.
        const Vector3 hinge = cross(a, mean);
        const Vector3 level =
            norm(hinge) > 1e-12 ? rotation_about(normalized(hinge), angle * kPi / 180) * (r * side)
                                : r * side;
        turned.x.push_back(static_cast<double>(i));
        turned.y.push_back(std::atan2(dot(level, v), dot(level, u)) * 180 / kPi);
    }
    const double step = widest > 40 ? 30 : widest > 15 ? 10 : 5;
    for (double r = step; r < widest + step; r += step) tilt.series.push_back(ring(r));
    tilt.series.push_back(used);
    if (!out.x.empty()) {
        Series near_by = marks("left out", kLeftOut, 5);
        near_by.look = SeriesLook::crosses;
        for (std::size_t i = 0; i < out.x.size(); ++i) {
            if (std::hypot(out.x[i], out.y[i]) > 1.5 * widest) continue;
            near_by.x.push_back(out.x[i]);
            near_by.y.push_back(out.y[i]);
        }
        tilt.series.push_back(near_by);
    }
    twist.series.push_back(turned);
    return {tilt, twist};
}

}  // namespace

Status draw_point_pictures(std::span<const Pose> readings,
                           const PointFit& fit,
                           const std::string& folder,
                           const std::string& name) {
    const std::vector<Pose> poses = screen_poses(readings).poses;
    std::vector<Chart> charts{
        residual_chart(fit.residuals, "Distance of the tip from its resting point", fit.rms_mm),
        histogram(fit.residuals)};
    for (Chart& c : coverage(poses, fit.tip_mm, fit.residuals)) charts.push_back(std::move(c));
    return draw(charts, 2, folder, name);
}

}  // namespace sonocase::pipeline
