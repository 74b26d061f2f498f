// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate needle: finds axis and tip of the needle from pivots through a pinhole.
#include <CLI/CLI.hpp>
#include <algorithm>

#include "formats/base/constants.h"
#include "formats/calibration/needle.h"
#include "formats/calibration/pose_screen.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

Json json_of(const NeedleFit& fit) {
    Json json;
    json["direction"] = json_triple(fit.direction);
    json["tip_mm"] = json_triple(fit.tip_mm);
    json["axis_point_mm"] = json_triple(fit.axis_point_mm);
    json["tip_measured"] = fit.tip_measured;
    json["direction_sigma_deg"] = json_number(fit.direction_sigma_rad / kRadPerDeg);
    json["tip_sigma_mm"] = json_triple(fit.tip_sigma_mm);
    json["rms_mm"] = json_number(fit.rms_mm);
    json["condition"] = json_number(fit.condition);
    json["poses"] = fit.poses;
    json["inliers"] = fit.inliers;
    json["paper"] = {{"direction", json_triple(fit.paper_direction)},
                     {"point_mm", json_triple(fit.paper_point_mm)}};
    json["depths"] = Json::array();
    for (const PointFit& p : fit.points) {
        json["depths"].push_back({{"point_mm", json_triple(p.tip_mm)},
                                  {"sigma_mm", json_triple(p.sigma_mm)},
                                  {"rms_mm", json_number(p.rms_mm)},
                                  {"poses", p.poses},
                                  {"inliers", p.inliers},
                                  {"determined", p.determined}});
    }
    return json;
}

Status draw_pictures(const NeedleFit& fit,
                     const std::vector<std::vector<Pose>>& recordings,
                     const std::string& folder) {
    if (auto s = draw_needle_pictures(fit, folder, "needle"); !s) return s;
    for (std::size_t k = 0; k < fit.points.size(); ++k) {
        if (auto s = draw_point_pictures(recordings[k], fit.points[k], folder,
                                         "depth" + std::to_string(k + 1));
            !s) {
            return s;
        }
    }
    return Done{};
}

Calibration calibration_of(const NeedleFit& fit) {
    Calibration calibration;
    calibration.kind = "needle";
    calibration.sensor_from_tool = fit.sensor_from_needle();
    calibration.rms_mm = fit.rms_mm;
    calibration.sigma_mm = fit.tip_sigma_mm;
    double worst = 1;
    for (const PointFit& p : fit.points) {
        if (p.determined) worst = std::max(worst, p.condition);
    }
    calibration.condition = worst;
    calibration.poses = fit.inliers;
    return calibration;
}

std::string people_text(const NeedleFit& fit) {
    return text_line(
        "direction  (%.4f, %.4f, %.4f) in the sensor, one sigma %.2f degrees\n"
        "tip        (%.2f, %.2f, %.2f) mm in the sensor%s\n"
        "fit        %.2f mm rms, %d of %d poses",
        fit.direction.x, fit.direction.y, fit.direction.z, fit.direction_sigma_rad / kRadPerDeg,
        fit.tip_mm.x, fit.tip_mm.y, fit.tip_mm.z, fit.tip_measured ? "" : " (not measured)",
        fit.rms_mm, fit.inliers, fit.poses);
}

}  // namespace

int calibrate_needle(int argc, char** argv) {
    CLI::App app(
        "Find a needle's axis and tip: from one pivot of the tip and a spin, or from pivots "
        "through a "
        "pinhole at several depths, one recording each",
        "sonocase calibrate needle");
    CalibrateOptions options;
    options.add(app, 0);
    std::vector<double> depths;
    std::string spin;
    app.add_option("--depths", depths, "Distance from the hole to the tip for each recording, mm")
        ->delimiter(',')
        ->type_name("MM,MM,...");
    app.add_option("--spin", spin,
                   "Recording of the needle spun in a groove: its axis, with the tip of one "
                   "--poses; compared with the pinholes of several")
        ->type_name("FILE");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (options.poses.empty() && spin.empty())
        return wrong_usage("calibrate", "give --poses, --spin or both");
    std::vector<std::vector<Pose>> recordings;
    std::vector<Pose> everything;
    for (std::size_t k = 0; k < options.poses.size(); ++k) {
        auto poses = options.recording(k);
        if (!poses) return fail("calibrate", poses.error());
        everything.insert(everything.end(), poses->begin(), poses->end());
        recordings.push_back(std::move(*poses));
    }
    NeedleFit fit;
    NeedleFit turned;
    if (!spin.empty()) {
        auto poses = options.load(spin);
        if (!poses) return fail("calibrate", poses.error());
        turned = fit_needle_spin(*poses);
        everything.insert(everything.end(), poses->begin(), poses->end());
    }
    NeedleOptions how;
    how.depths_mm = depths;
    // One recording beside a spin is a pivot of the tip itself.
    const bool joined = recordings.size() == 1 && !spin.empty();
    if (joined) {
        const PointFit pivot = fit_point(recordings[0], how.point);
        fit = join_pivot_and_spin(pivot, turned);
        if (const std::string misread = misread_poses(recordings[0], pivot, how.point);
            !misread.empty()) {
            fit.problem += (fit.problem.empty() ? "" : "; ") + misread;
            fit.determined = false;
        }
    } else if (!recordings.empty()) {
        fit = fit_needle(recordings, how);
    } else {
        fit = turned;
        if (fit.determined)
            fit.problem =
                "a spin gives neither the tip nor which way the needle points, so that nothing is "
                "saved; add --poses PIVOT with the tip on a fixed point";
        fit.determined = false;
    }
    std::vector<std::string> warnings = fit.warnings;
    Json json = json_of(fit);
    if (!spin.empty() && recordings.size() > 1) {
        const NeedleAgreement same = compare(fit, turned);
        json["spin"] = {{"direction", json_triple(turned.direction)},
                        {"angle_deg", json_number(same.angle_rad / kRadPerDeg)},
                        {"distance_mm", json_number(same.distance_mm)},
                        {"agree", same.agree},
                        {"sentence", same.sentence}};
        if (!same.agree)
            warnings.push_back(turned.determined ? same.sentence : "Spin: " + turned.problem + ".");
    }
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["warnings"] = warnings;
    if (!options.pictures.empty()) {
        if (auto s = draw_pictures(fit, recordings, options.pictures); !s)
            return fail("calibrate", s.error());
    }
    Calibration calibration = calibration_of(fit);
    calibration.data_digest = digest_of_poses(everything);
    return finish_calibration(options, json, people_text(fit), calibration, fit.problem, warnings,
                              watch.seconds());
}

}  // namespace sonocase::pipeline::inline verbs
