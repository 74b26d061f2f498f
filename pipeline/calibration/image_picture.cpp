// SPDX-License-Identifier: Apache-2.0

// The picture of the image calibration: outline, mark, letter and touches.
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/chart_parts.h"

namespace sonocase::pipeline {

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

}  // namespace sonocase::pipeline
