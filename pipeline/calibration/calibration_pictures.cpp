// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/calibration_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "formats/base/constants.h"
#include "formats/base/result.h"
#include "formats/calibration/point.h"
#include "formats/calibration/pose_screen.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline::inline calibration {

namespace {

using ChartColour = std::array<std::uint8_t, 3>;
constexpr ChartColour kUsed{31, 119, 180}, kLeftOut{214, 39, 40}, kGuide{150, 150, 150},
    kSecond{255, 127, 14}, kThird{44, 160, 44};

// Writes FOLDER/NAME.png and .svg; makes the folder.
Status draw(std::span<const Chart> charts,
            int columns,
            const std::string& folder,
            const std::string& name) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    const ChartSheet sheet{{charts.begin(), charts.end()}, columns, 560, 420};
    if (Status s = write_chart_png(sheet, folder + "/" + name + ".png"); !s) return s;
    return write_chart_svg(sheet, folder + "/" + name + ".svg");
}

Series marks(const std::string& name, ChartColour colour, double size = 5) {
    Series s;
    s.name = name;
    s.colour = colour;
    s.style = SeriesStyle::points;
    s.width_px = size / 3;
    return s;
}

Series stroke(const std::string& name, ChartColour colour, double width = 1.5) {
    Series s;
    s.name = name;
    s.colour = colour;
    s.width_px = width;
    return s;
}

// Draws the residual of each reading, those left out as crosses.
Chart residual_chart(std::span<const PoseResidual> residuals,
                     const std::string& title,
                     double rms_mm) {
    Chart chart{title, "reading", "residual [mm]", false, false, {}, false};
    Series used = marks("used", kUsed, 4), out = marks("left out", kLeftOut, 6);
    out.style = SeriesStyle::crosses;
    // Outliers are far away: they are shown at the upper edge.
    const double edge = std::max(8 * rms_mm, 1e-6);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
        Series& s = residuals[i].inlier ? used : out;
        s.x.push_back(static_cast<double>(i));
        s.y.push_back(std::min(residuals[i].residual_mm, edge));
    }
    Series level = stroke("rms of those used", kGuide, 1);
    level.style = SeriesStyle::dashed;
    level.x = {0, static_cast<double>(residuals.size())};
    level.y = {rms_mm, rms_mm};
    chart.series = {used, out, level};
    if (out.x.empty()) chart.series.erase(chart.series.begin() + 1);
    return chart;
}

}  // namespace

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
        // The line is drawn in the tracker's frame, by the mean orientation.
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
    tip.style = SeriesStyle::diamonds;
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
        out.style = SeriesStyle::crosses;
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

namespace {

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
        ++count[std::min(kBins - 1, static_cast<int>(v / top * kBins))];
    }
    Series steps = stroke("", kUsed, 2);
    for (int k = 0; k < kBins; ++k) {
        for (int side = 0; side < 2; ++side) {
            steps.x.push_back(top * (k + side) / kBins);
            steps.y.push_back(count[k]);
        }
    }
    chart.series = {steps};
    return chart;
}

// Draws how the tool was held: the tilt of its long axis (towards the tip) from the mean in two
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
    out.style = SeriesStyle::crosses;
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
        near_by.style = SeriesStyle::crosses;
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

Status draw_image_picture(const ImagePlaneInput& input,
                          const ImagePlane& plane,
                          const std::string& folder,
                          const std::string& name) {
    // The letter is written on the probe's body, its foot towards the tissue and its back towards
    // the mark. In a frame that is mirrored or upside down it is seen mirrored or upside down.
    const double sign = plane.lateral_sign;
    const auto panel = [&](const std::string& title, const Rigid& sensor_from_frame) {
        Chart chart{title,
                    sign < 0 ? "<- mark        lateral [mm]" : "lateral [mm]        mark ->",
                    "depth [mm], downwards",
                    false,
                    false,
                    {},
                    true};
        const Rigid frame_from_sensor = inverse(sensor_from_frame);
        const auto at_frame = [&](Point3 p, Series& s) {
            s.x.push_back(sign * p.x);
            s.y.push_back(-p.z);
        };
        const auto at_body = [&](Point3 p, Series& s) {
            at_frame(frame_from_sensor * (plane.sensor_from_probe * p), s);
        };
        Series outline = stroke("", kGuide, 2), face = stroke("face", kThird, 5);
        Series mark = marks("mark on the screen", kLeftOut, 10), letter = stroke("", kUsed, 4);
        const double w = input.width_px - 1.0, h = input.height_px - 1.0;
        for (const auto& [u, v] : {std::pair{0.0, 0.0}, {w, 0.0}, {w, h}, {0.0, h}, {0.0, 0.0}}) {
            at_frame(plane.probe_from_pixel(u, v), outline);
        }
        const double half = 0.5 * plane.footprint_mm, size = 0.12 * input.depth_mm;
        at_body({half, 0, 0}, face);
        at_body({-half, 0, 0}, face);
        at_frame({0.5 * w * plane.mm_per_px, 0, -0.05 * input.depth_mm}, mark);
        const auto pen = [&](double x, double y) {
            at_body({-x * size, 0, 0.45 * input.depth_mm - y * size}, letter);
        };
        // An F if the mark is on the left; on the right its back still points to the mark.
        pen(-0.5, -1);
        pen(-0.5, 1);
        pen(0.6, 1);
        pen(-0.5, 1);
        pen(-0.5, 0.1);
        pen(0.3, 0.1);
        chart.series = {outline, face, letter, mark};
        const auto touches = [&](std::span<const Point3> points, const char* label,
                                 ChartColour colour) {
            Series s = marks(label, colour, 8);
            for (const Point3& p : points) at_frame(frame_from_sensor * p, s);
            if (!s.x.empty()) chart.series.push_back(s);
        };
        touches(input.mark_end, "touched: marked end", kSecond);
        touches(input.other_end, "touched: other end", {140, 86, 75});
        touches(input.in_front, "touched: in front", {148, 103, 189});
        return chart;
    };
    std::vector<Chart> charts;
    if (plane.mirrored || plane.upside_down) {
        charts.push_back(panel(plane.mirrored && plane.upside_down
                                   ? "As given: MIRRORED and UPSIDE DOWN"
                               : plane.mirrored ? "As given: MIRRORED"
                                                : "As given: UPSIDE DOWN",
                               input.sensor_from_probe));
        charts.push_back(panel("As turned round and saved", plane.sensor_from_probe));
    } else {
        charts.push_back(panel("The image as it will be shown", plane.sensor_from_probe));
    }
    return draw(charts, 2, folder, name);
}

}  // namespace sonocase::pipeline::inline calibration
