// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate mannequin, image, lag: how things stand to one another.
#include <CLI/CLI.hpp>
#include <cmath>

#include "formats/calibration/image_plane.h"
#include "formats/calibration/lag.h"
#include "formats/calibration/landmarks.h"
#include "formats/calibration/pose_screen.h"
#include "formats/calibration/quality.h"
#include "formats/files/atomic_file.h"
#include "formats/files/calibration_file.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/touched_points.h"
#include "pipeline/import/surface/surface_file.h"
#include "pipeline/verbs/calibrate/calibrate_common.h"

namespace sonocase::pipeline {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

}  // namespace

int calibrate_mannequin(int argc, char** argv) {
    CLI::App app(
        "Find where the mannequin stands today, from landmarks touched on it or a sweep of its "
        "skin",
        "sonocase calibrate mannequin");
    CalibrateOptions options;
    options.add(app, 0);
    std::string landmarks, touched, surface, tool, start;
    bool scale = false;
    app.add_option("--landmarks", landmarks,
                   "Where they are on the mannequin: rows name,x,y,z (mannequin frame)")
        ->type_name("FILE.csv");
    app.add_option("--touched", touched,
                   "Where they were touched: rows name,x,y,z (world frame); instead, --poses with "
                   "--tool: the rests "
                   "of the tip, in the order of the landmarks")
        ->type_name("FILE.csv");
    app.add_option("--surface", surface,
                   "Mannequin's surface, to lay a sweep of --poses or --touched on")
        ->type_name("FILE");
    app.add_option("--tool", tool, "Calibration of the tool that touched")->type_name("CAL.json");
    app.add_option("--start", start,
                   "Earlier calibration of this mannequin to start the sweep from")
        ->type_name("CAL.json");
    app.add_flag("--scale", scale, "Allow one uniform scale");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (landmarks.empty() && surface.empty())
        return wrong_usage("calibrate", "give --landmarks or --surface");
    if (touched.empty() && options.poses.empty())
        return wrong_usage("calibrate", "give --touched or --poses with --tool");
    if (!options.poses.empty() && tool.empty())
        return wrong_usage("calibrate", "--poses needs --tool CAL.json");

    std::vector<std::string> warnings;
    std::string digest;
    NamedPoints world;
    std::vector<Pose> poses;
    if (!touched.empty()) {
        auto read = load_named_points(touched);
        if (!read) return fail("calibrate", read.error());
        world = std::move(*read);
    } else {
        auto held = load_calibration(tool);
        if (!held) return fail("calibrate", held.error());
        for (const std::string& c : calibration_concerns(*held, options.today()))
            warnings.push_back(c);
        for (std::size_t k = 0; k < options.poses.size(); ++k) {
            auto part = options.recording(k);
            if (!part) return fail("calibrate", part.error());
            poses.insert(poses.end(), part->begin(), part->end());
        }
        PoseScreen screen = screen_poses(poses);
        warnings.insert(warnings.end(), screen.warnings.begin(), screen.warnings.end());
        const Vector3 tip = held->sensor_from_tool.translation;
        if (!surface.empty()) {
            world.points = tip_trace(screen.poses, tip);
        } else {
            for (const RestPoint& r : find_rests(screen.poses, tip))
                world.points.push_back(r.pivot_mm);
        }
        digest = digest_of_poses(poses);
    }
    if (digest.empty()) digest = digest_of_points(world.points);

    RigidFit fit;
    NamedPoints known;
    Surface skin;
    if (!landmarks.empty()) {
        auto read = load_named_points(landmarks);
        if (!read) return fail("calibrate", read.error());
        known = std::move(*read);
    }
    if (surface.empty()) {
        // By name where both have names, else by order.
        auto paired = pair_points(known, world);
        if (!paired) {
            Error e = paired.error();
            e.where = touched.empty() ? options.poses[0] : touched;
            return fail("calibrate", e);
        }
        known = paired->first;
        world = paired->second;
        fit = fit_rigid(known.points, world.points, known.names, {.fit_scale = scale});
    } else {
        auto read = import_surface(surface);
        if (!read) return fail("calibrate", read.error());
        skin = std::move(*read);
        SweepOptions how;
        how.fit_scale = scale;
        if (!start.empty()) {
            auto before = load_calibration(start);
            if (!before) return fail("calibrate", before.error());
            how.has_start = true;
            how.start = before->sensor_from_tool;
        }
        // Readings a tenth of a second apart tell the same: 1,500 are plenty.
        NamedPoints thin;
        const std::size_t stride = std::max<std::size_t>(1, world.points.size() / 1500);
        for (std::size_t i = 0; i < world.points.size(); i += stride)
            thin.points.push_back(world.points[i]);
        world = thin;
        fit = fit_skin_sweep(skin, world.points, how);
        known.points = skin.points;
    }
    warnings.insert(warnings.end(), fit.warnings.begin(), fit.warnings.end());
    Json json;
    json["world_from_mannequin"] = {{"rotation", json_matrix(fit.to_from.rotation)},
                                    {"translation_mm", json_triple(fit.to_from.translation)},
                                    {"scale", json_number(fit.scale)}};
    json["rms_mm"] = json_number(fit.rms_mm);
    json["sigma_mm"] = json_triple(fit.sigma_mm);
    json["sigma_deg"] = json_triple(fit.sigma_rad / kDegree);
    json["scale_seen"] = json_number(fit.scale_seen);
    json["condition"] = json_number(fit.condition);
    json["points"] = fit.points;
    json["inliers"] = fit.inliers;
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["warnings"] = warnings;
    json["residuals_mm"] = fit.residuals_mm;
    if (!options.pictures.empty() && fit.determined) {
        if (auto s =
                draw_rigid_pictures(known.points, world.points, fit, options.pictures, "mannequin");
            !s) {
            return fail("calibrate", s.error());
        }
    }
    Calibration calibration;
    calibration.kind = "mannequin";
    calibration.sensor_from_tool = fit.to_from;
    calibration.scale = fit.scale;
    calibration.rms_mm = fit.rms_mm;
    calibration.sigma_mm = fit.sigma_mm;
    calibration.condition = fit.condition;
    calibration.poses = fit.inliers;
    calibration.data_digest = digest;
    const std::string people = text_line(
        "world_from_mannequin  turn %.2f degrees, shift (%.2f, %.2f, %.2f) mm, scale %.4f\n"
        "fit                   %.2f mm rms, %d of %d points, one sigma (%.2f, %.2f, %.2f) mm",
        rotation_angle(fit.to_from.rotation) / kDegree, fit.to_from.translation.x,
        fit.to_from.translation.y, fit.to_from.translation.z, fit.scale, fit.rms_mm, fit.inliers,
        fit.points, fit.sigma_mm.x, fit.sigma_mm.y, fit.sigma_mm.z);
    return finish_calibration(options, json, people, calibration, fit.problem, warnings,
                              watch.seconds());
}

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
    json["face_angle_deg"] = json_number(plane.face_angle_rad / kDegree);
    json["off_plane_mm"] = json_number(plane.off_plane_mm);
    json["rms_mm"] = json_number(plane.rms_mm);
    json["determined"] = plane.determined;
    json["problem"] = plane.problem;
    json["warnings"] = plane.warnings;
    if (!options.pictures.empty() && plane.determined) {
        if (auto s = draw_image_picture(input, plane, options.pictures, "image"); !s)
            return fail("calibrate", s.error());
    }
    Calibration calibration = *held;
    calibration.sensor_from_tool = plane.sensor_from_probe;
    if (options.sensor.empty()) options.sensor = held->sensor;
    const std::string people =
        text_line("face %.1f mm wide, %.4f mm a pixel, mark on the %s%s", plane.footprint_mm,
                  plane.mm_per_px, input.mark_on_left ? "left" : "right",
                  plane.mirrored ? "; the frame was mirrored and is turned round" : "");
    return finish_calibration(options, json, people, calibration, plane.problem, plane.warnings,
                              watch.seconds());
}

int calibrate_lag(int argc, char** argv) {
    CLI::App app("Find how much later the second recording shows a motion than the first",
                 "sonocase calibrate lag");
    CalibrateOptions options;
    options.add(app, 1);
    LagOptions how;
    std::string signal = "speed", values;
    app.add_option("--max-lag", how.max_lag_s, "Largest lag looked for, s")
        ->check(CLI::Range(0.01, 10.0))
        ->capture_default_str();
    app.add_option("--signal", signal, "What of a pose is compared")
        ->check(CLI::IsMember({"speed", "position"}))
        ->capture_default_str();
    app.add_option("--values", values,
                   "Second signal as rows time_s,value, e.g. the height of a line in the image, "
                   "instead of a second "
                   "recording")
        ->type_name("FILE.csv");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (options.poses.size() != (values.empty() ? 2u : 1u)) {
        return wrong_usage("calibrate", "lag takes two recordings, or one and --values");
    }
    if (!values.empty()) signal = "position";
    std::vector<Signal> signals;
    for (const std::string& path : options.poses) {
        auto poses = options.load(path);
        if (!poses) return fail("calibrate", poses.error());
        signals.push_back(signal == "speed" ? speed_signal(*poses) : position_signal(*poses));
    }
    if (!values.empty()) {
        auto read = load_signal(values);
        if (!read) return fail("calibrate", read.error());
        signals.push_back(std::move(*read));
    }
    const LagFit fit = fit_lag(signals[0], signals[1], how);
    Json json;
    json["lag_s"] = json_number(fit.lag_s);
    json["sigma_s"] = json_number(fit.sigma_s);
    json["correlation"] = json_number(fit.correlation);
    json["overlap_s"] = json_number(fit.overlap_s);
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["warnings"] = fit.warnings;
    if (!options.pictures.empty()) {
        if (auto s = draw_lag_pictures(signals[0], signals[1], fit, options.pictures, "lag"); !s)
            return fail("calibrate", s.error());
    }
    if (!options.output.empty() && fit.determined) {
        // A file of its own: a lag is no frame.
        Json file = {{"sonocase", "lag"},
                     {"version", 1},
                     {"lag_s", json_number(fit.lag_s)},
                     {"sigma_s", json_number(fit.sigma_s)},
                     {"correlation", json_number(fit.correlation)},
                     {"date", options.today()},
                     {"sensor", options.sensor},
                     {"warnings", fit.warnings}};
        if (auto s = write_file(options.output, std::string_view(file.dump(2) + "\n")); !s)
            return fail("calibrate", s.error());
        options.output.clear();
    }
    const std::string people =
        text_line("the second is %.1f ms later than the first, one sigma %.1f ms, correlation %.3f",
                  1e3 * fit.lag_s, 1e3 * fit.sigma_s, fit.correlation);
    return finish_calibration(options, json, people, {}, fit.problem, fit.warnings,
                              watch.seconds());
}

}  // namespace sonocase::pipeline
