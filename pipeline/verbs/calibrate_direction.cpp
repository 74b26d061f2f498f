// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate direction: finds the probe's axes from a sweep along each.
#include <CLI/CLI.hpp>
#include <algorithm>

#include "formats/base/constants.h"
#include "formats/calibration/direction.h"
#include "formats/calibration/pose_screen.h"
#include "formats/files/load_save.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

Json json_of(const DirectionFit& fit) {
    return {{"direction", json_triple(fit.direction)},
            {"sigma_deg", json_number(fit.sigma_rad / kRadPerDeg)},
            {"rms_mm", json_number(fit.rms_mm)},
            {"length_mm", json_number(fit.length_mm)},
            {"turn_deg", json_number(fit.turn_rad / kRadPerDeg)},
            {"condition", json_number(fit.condition)},
            {"poses", fit.poses},
            {"inliers", fit.inliers},
            {"determined", fit.determined}};
}

}  // namespace

int calibrate_direction(int argc, char** argv) {
    CLI::App app(
        "Find the probe's axes: the first recording sweeps into the body (depth), the second along "
        "the "
        "face towards the orientation mark (lateral)",
        "sonocase calibrate direction");
    CalibrateOptions options;
    options.add(app, 1);
    std::string point;
    app.add_option("--point", point,
                   "Point calibration: its tip is followed, and becomes the frame's origin")
        ->type_name("CAL.json");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (options.poses.size() > 2)
        return wrong_usage("calibrate", "direction takes one or two recordings");
    Calibration calibration;
    calibration.kind = "probe";
    DirectionOptions how;
    if (!point.empty()) {
        auto loaded = load_calibration(point);
        if (!loaded) return fail("calibrate", loaded.error());
        calibration = *loaded;
        how.tip_mm = loaded->sensor_from_tool.translation;
    }
    std::vector<DirectionFit> fits;
    std::vector<std::string> warnings;
    static constexpr const char* kNames[] = {"depth", "lateral"};
    Json json;
    std::string people, problem;
    std::vector<Pose> everything;
    for (std::size_t k = 0; k < options.poses.size(); ++k) {
        auto poses = options.recording(k);
        if (!poses) return fail("calibrate", poses.error());
        everything.insert(everything.end(), poses->begin(), poses->end());
        const DirectionFit fit = fit_direction(*poses, how);
        const std::string name = kNames[k];
        json[name] = json_of(fit);
        for (const std::string& w : fit.warnings) warnings.push_back(name + " sweep: " + w);
        if (!fit.determined && problem.empty()) problem = name + " sweep: " + fit.problem;
        people += text_line(
            "%-8s (%.4f, %.4f, %.4f) in the sensor, one sigma %.2f degrees, %.0f mm, %.2f mm rms\n",
            name.c_str(), fit.direction.x, fit.direction.y, fit.direction.z,
            fit.sigma_rad / kRadPerDeg, fit.length_mm, fit.rms_mm);
        if (!options.pictures.empty()) {
            if (auto s = draw_direction_pictures(*poses, fit, options.pictures, name); !s)
                return fail("calibrate", s.error());
        }
        calibration.rms_mm = std::max(calibration.rms_mm, fit.rms_mm);
        calibration.condition = std::max(calibration.condition, 1.0);
        calibration.poses = std::max(calibration.poses, fit.inliers);
        fits.push_back(fit);
    }
    if (fits.size() == 2 && problem.empty()) {
        const ProbeFrame frame = make_probe_frame(fits[0], fits[1]);
        json["raw_angle_deg"] = json_number(frame.raw_angle_rad / kRadPerDeg);
        json["sensor_from_probe"] = json_matrix(frame.sensor_from_probe);
        json["sigma_deg"] = json_number(frame.sigma_rad / kRadPerDeg);
        problem = frame.problem;
        warnings.insert(warnings.end(), frame.warnings.begin(), frame.warnings.end());
        people += text_line(
            "angle between the two as measured %.2f degrees; the frame is made orthonormal",
            frame.raw_angle_rad / kRadPerDeg);
        calibration.sensor_from_tool.rotation = frame.sensor_from_probe;
    } else if (problem.empty()) {
        if (!options.output.empty()) {
            return wrong_usage("calibrate", "a frame needs two recordings: depth, then lateral");
        }
        people.pop_back();
    }
    if (point.empty()) calibration.sigma_mm = {-1, -1, -1};
    calibration.data_digest = digest_of_poses(everything);
    json["determined"] = problem.empty();
    json["problem"] = problem;
    json["warnings"] = warnings;
    return finish_calibration(options, json, people, calibration, problem, warnings,
                              watch.seconds());
}

}  // namespace sonocase::pipeline::inline verbs
