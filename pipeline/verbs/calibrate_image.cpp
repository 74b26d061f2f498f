// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate image: places the image in the probe, from touches of both ends of the face.
#include <CLI/CLI.hpp>

#include "formats/base/constants.h"
#include "formats/calibration/image_plane.h"
#include "formats/files/load_save.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/touched_points.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

Json json_of(const ImagePlane& plane) {
    Json json;
    json["sensor_from_probe"] = {
        {"rotation", json_matrix(plane.sensor_from_probe.rotation)},
        {"translation_mm", json_triple(plane.sensor_from_probe.translation)}};
    json["footprint_mm"] = json_number(plane.footprint_mm);
    json["mm_per_px"] = json_number(plane.mm_per_px);
    json["middle_px"] = {json_number(plane.u0), json_number(plane.v0)};
    json["lateral_sign"] = plane.lateral_sign;
    json["mirrored"] = plane.mirrored;
    json["upside_down"] = plane.upside_down;
    json["face_angle_deg"] = json_number(plane.face_angle_rad / kRadPerDeg);
    json["off_plane_mm"] = json_number(plane.off_plane_mm);
    json["rms_mm"] = json_number(plane.rms_mm);
    json["determined"] = plane.determined;
    json["problem"] = plane.problem;
    json["warnings"] = plane.warnings;
    return json;
}

}  // namespace

int calibrate_image(int argc, char** argv) {
    CLI::App app(
        "Place the image in the probe from touches of both ends of its face; shows a mirrored "
        "image",
        "sonocase calibrate image");
    CalibrateOptions options;
    options.add(app, 0);
    std::string probe, touches;
    ImagePlaneInput input;
    bool mark_right = false;
    app.add_option("--probe", probe, "Probe calibration (point and directions)")
        ->type_name("CAL.json")
        ->required();
    app.add_option(
           "--touched", touches,
           "Touches in the probe sensor's frame: rows name,x,y,z with names mark, other and front")
        ->type_name("FILE.csv")
        ->required();
    app.add_option("--depth", input.depth_mm, "Depth of the image, mm")
        ->check(CLI::Range(5.0, 500.0))
        ->capture_default_str();
    app.add_option("--footprint", input.footprint_mm, "Width of the face, mm; 0: from the touches")
        ->check(CLI::Range(0.0, 300.0))
        ->capture_default_str();
    app.add_option("--width", input.width_px, "Image width, pixels")
        ->check(CLI::Range(2, 10000))
        ->capture_default_str();
    app.add_option("--height", input.height_px, "Image height, pixels")
        ->check(CLI::Range(2, 10000))
        ->capture_default_str();
    app.add_flag("--mark-right", mark_right, "The orientation mark is drawn on the right");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    auto held = load_calibration(probe);
    if (!held) return fail("calibrate", held.error());
    auto read = load_named_points(touches);
    if (!read) return fail("calibrate", read.error());
    input.sensor_from_probe = held->sensor_from_tool;
    input.mark_on_left = !mark_right;
    for (std::size_t i = 0; i < read->points.size(); ++i) {
        const std::string& name = read->names[i];
        if (name != "mark" && name != "other" && name != "front") {
            return fail("calibrate", {"a touch is called \"" + name + "\"", touches,
                                      "call it mark, other or front"});
        }
        (name == "mark"    ? input.mark_end
         : name == "other" ? input.other_end
                           : input.in_front)
            .push_back(read->points[i]);
    }
    const ImagePlane plane = fit_image_plane(input);
    const Json json = json_of(plane);
    if (!options.pictures.empty() && plane.determined) {
        if (auto s = draw_image_picture(input, plane, options.pictures, "image"); !s)
            return fail("calibrate", s.error());
    }
    Calibration calibration = *held;
    calibration.sensor_from_tool = plane.sensor_from_probe;
    if (options.sensor.empty()) options.sensor = held->sensor;
    const std::string people =
        text_line("face %.1f mm wide, %.4f mm per pixel, mark on the %s%s", plane.footprint_mm,
                  plane.mm_per_px, input.mark_on_left ? "left" : "right",
                  plane.mirrored ? "; the frame was mirrored and is turned round" : "");
    return finish_calibration(options, json, people, calibration, plane.problem, plane.warnings,
                              watch.seconds());
}

}  // namespace sonocase::pipeline::inline verbs
