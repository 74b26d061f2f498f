// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/calibration_pictures.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/pose_screen.h"
#include "pipeline/calibration/chart_parts.h"

namespace sonocase::pipeline {

Status draw_direction_pictures(std::span<const Pose> readings,
                               const DirectionFit& fit,
                               const std::string& folder,
                               const std::string& name) {
    const std::vector<Pose> poses = screen_poses(readings).poses;
    std::vector<Chart> charts{residual_chart(fit.residuals, "Distance from the line", fit.rms_mm)};
    Chart path{
        "Path along and across the line", "along [mm]", "across [mm]", false, false, {}, false};
    Chart time{"Position along the line", "reading", "along [mm]", false, false, {}, false};
    if (!poses.empty()) {
        // The line in the tracker's frame, by the mean orientation.
        Vector3 way;
        for (const Pose& p : poses) way = way + p.tracker_from_tool.rotation * fit.direction;
        way = norm(way) > 1e-9 ? normalized(way) : Vector3{0, 0, 1};
        const Vector3 u = any_perpendicular(way), v = cross(way, u);
        Series a = stroke("first direction across", kUsed), b = stroke("second", kSecond),
               s = stroke("", kUsed);
        const Vector3 first = poses[0].tracker_from_tool.translation;
        for (std::size_t i = 0; i < poses.size(); ++i) {
            const Vector3 d = poses[i].tracker_from_tool.translation - first;
            a.x.push_back(dot(d, way));
            a.y.push_back(dot(d, u));
            b.x.push_back(dot(d, way));
            b.y.push_back(dot(d, v));
            s.x.push_back(static_cast<double>(i));
            s.y.push_back(dot(d, way));
        }
        path.series = {a, b};
        time.series = {s};
    }
    charts.push_back(path);
    charts.push_back(time);
    return draw(charts, 2, folder, name);
}

Status draw_needle_pictures(const NeedleFit& fit,
                            const std::string& folder,
                            const std::string& name) {
    Chart axis{"Pinholes along the needle",
               "along [mm], tip at 0",
               "across [mm]",
               false,
               false,
               {},
               false};
    const Vector3 u = any_perpendicular(fit.direction), v = cross(fit.direction, u);
    Series a = marks("first direction across", kUsed, 8), b = marks("second", kSecond, 8),
           tip = marks("tip", kLeftOut, 10);
    tip.look = SeriesLook::diamonds;
    double low = 0;
    for (const PointFit& p : fit.points) {
        if (!p.determined) continue;
        const Vector3 d = p.tip_mm - fit.tip_mm;
        const double s = dot(d, fit.direction);
        low = std::min(low, s);
        a.x.push_back(s);
        a.y.push_back(dot(d, u));
        b.x.push_back(s);
        b.y.push_back(dot(d, v));
    }
    tip.x = {0};
    tip.y = {0};
    Series line = stroke("", kGuide, 1);
    line.x = {low, 0};
    line.y = {0, 0};
    axis.series = {line, a, b, tip};
    std::vector<Chart> charts{axis};
    Chart fits{"Quality of each depth", "recording", "mm", false, false, {}, false};
    Series rms = marks("rms", kUsed, 8), sigma = marks("one sigma, weakest direction", kSecond, 8);
    for (std::size_t k = 0; k < fit.points.size(); ++k) {
        if (!fit.points[k].determined) continue;
        rms.x.push_back(static_cast<double>(k + 1));
        rms.y.push_back(fit.points[k].rms_mm);
        sigma.x.push_back(static_cast<double>(k + 1));
        sigma.y.push_back(fit.points[k].weak_sigma_mm);
    }
    fits.series = {rms, sigma};
    if (!rms.x.empty()) charts.push_back(fits);
    return draw(charts, 2, folder, name);
}

Status draw_rigid_pictures(std::span<const Point3> from,
                           std::span<const Point3> to,
                           const RigidFit& fit,
                           const std::string& folder,
                           const std::string& name) {
    std::vector<Chart> charts;
    static constexpr const char* kPlanes[] = {"from the front: x, z", "from the side: y, z",
                                              "from above: x, y"};
    static constexpr int kAxes[][2] = {{0, 2}, {1, 2}, {0, 1}};
    const Rigid back = inverse(fit.to_from);
    for (int plane = 0; plane < 3; ++plane) {
        Chart chart{std::string("Mannequin ") + kPlanes[plane], "mm", "mm", false, false, {}, true};
        Series known = marks("mannequin", kGuide, from.size() > 100 ? 3 : 9);
        Series touched = marks("touched", kUsed, to.size() > 100 ? 3 : 7),
               out = marks("left out", kLeftOut, 7);
        out.look = SeriesLook::crosses;
        const int a = kAxes[plane][0], b = kAxes[plane][1];
        const std::size_t thin = std::max<std::size_t>(1, from.size() / 4000);
        for (std::size_t i = 0; i < from.size(); i += thin) {
            known.x.push_back(from[i][a]);
            known.y.push_back(from[i][b]);
        }
        for (std::size_t i = 0; i < to.size(); ++i) {
            const Point3 q = back * to[i];
            Series& s = i < fit.used.size() && !fit.used[i] ? out : touched;
            s.x.push_back(q[a] / fit.scale);
            s.y.push_back(q[b] / fit.scale);
        }
        chart.series = {known, touched};
        if (!out.x.empty()) chart.series.push_back(out);
        charts.push_back(chart);
    }
    Chart residuals{"Distance after the fit", "reading", "mm", false, false, {}, false};
    Series used = marks("used", kUsed, 6), out = marks("left out", kLeftOut, 6);
    for (std::size_t i = 0; i < fit.residuals_mm.size(); ++i) {
        if (fit.residuals_mm[i] < 0) continue;
        Series& s = fit.used[i] ? used : out;
        s.x.push_back(static_cast<double>(i + 1));
        s.y.push_back(fit.residuals_mm[i]);
    }
    residuals.series = {used};
    if (!out.x.empty()) residuals.series.push_back(out);
    charts.push_back(residuals);
    return draw(charts, 2, folder, name);
}

Status draw_lag_pictures(const Signal& first,
                         const Signal& second,
                         const LagFit& fit,
                         const std::string& folder,
                         const std::string& name) {
    Chart curve{"Correlation over lag", "lag [s]", "correlation", false, false, {}, false};
    Series c = stroke("", kUsed, 2), peak = marks("estimate", kLeftOut, 10);
    c.x = fit.curve_lag_s;
    c.y = fit.curve;
    peak.x = {fit.lag_s};
    peak.y = {fit.correlation};
    curve.series = {c, peak};
    Chart both{"The two signals, the second moved by the lag",
               "time [s]",
               "normalised",
               false,
               false,
               {},
               false};
    const auto line = [](const Signal& s, double shift, double sign, const std::string& label,
                         ChartColour colour) {
        Series out = stroke(label, colour, 1.5);
        double mean = 0, square = 0;
        for (double v : s.value) mean += v / static_cast<double>(s.value.size());
        for (double v : s.value)
            square += (v - mean) * (v - mean) / static_cast<double>(s.value.size());
        for (std::size_t i = 0; i < s.value.size(); ++i) {
            out.x.push_back(s.time_s[i] - shift);
            out.y.push_back(sign * (s.value[i] - mean) / std::sqrt(std::max(square, 1e-300)));
        }
        return out;
    };
    both.series = {line(first, 0, 1, "first", kUsed),
                   line(second, fit.lag_s, fit.correlation < 0 ? -1 : 1, "second", kSecond)};
    return draw(std::vector<Chart>{curve, both}, 2, folder, name);
}

}  // namespace sonocase::pipeline
