// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate point, direction, needle: what is fixed to a sensor.
#include <CLI/CLI.hpp>
#include <cmath>

#include "formats/calibration/direction.h"
#include "formats/calibration/needle.h"
#include "formats/calibration/point.h"
#include "formats/calibration/pose_screen.h"
#include "formats/files/calibration_file.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/refine_point.h"
#include "pipeline/verbs/calibrate/calibrate_common.h"

namespace sonocase::pipeline {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

}  // namespace

int calibrate_point(int argc, char** argv) {
    CLI::App app(
        "Find the tip of a tool that rests on a fixed point while it is tilted every way (pivot)",
        "sonocase calibrate point");
    CalibrateOptions options;
    options.add(app, 1);
    std::string rests = "auto";
    app.add_option("--rests", rests, "Resting points in the recording")
        ->check(CLI::IsMember({"one", "auto", "several"}))
        ->capture_default_str();
    bool all = false, refine = false;
    app.add_flag("--all", all, "Use every pose: no robust fit");
    app.add_flag("--refine", refine, "Refine with noise in orientation as well (Ceres)");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    std::vector<Pose> poses;
    for (std::size_t k = 0; k < options.poses.size(); ++k) {
        auto part = options.recording(k);
        if (!part) return fail("calibrate", part.error());
        poses.insert(poses.end(), part->begin(), part->end());
    }
    PointOptions how;
    how.rests = rests == "one"       ? RestSearch::one
                : rests == "several" ? RestSearch::several
                                     : RestSearch::automatic;
    how.reject_outliers = !all;
    const PointFit fit = fit_point(poses, how);
    Json json;
    json["tip_mm"] = json_triple(fit.tip_mm);
    json["pivot_mm"] = json_triple(fit.pivot_mm);
    json["rms_mm"] = json_number(fit.rms_mm);
    json["sigma_mm"] = json_triple(fit.sigma_mm);
    json["condition"] = json_number(fit.condition);
    json["poses"] = fit.poses;
    json["inliers"] = fit.inliers;
    std::vector<std::string> warnings = fit.warnings;
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["pivot_sigma_mm"] = json_triple(fit.pivot_sigma_mm);
    json["paper"] = {{"d1_mm", json_number(fit.d1_mm)},
                     {"d2_mm", json_number(fit.d2_mm)},
                     {"theta_rad", json_number(fit.theta_rad)}};
    json["weakest"] = {{"axis", json_triple(fit.weak_axis)},
                       {"sigma_mm", json_number(fit.weak_sigma_mm)}};
    json["swing_deg"] = json_triple(Vector3{std::asin(std::min(1.0, fit.swing.x)) / kDegree,
                                            std::asin(std::min(1.0, fit.swing.y)) / kDegree,
                                            std::asin(std::min(1.0, fit.swing.z)) / kDegree});
    json["correlation"] = json_number(fit.correlation);
    json["rests"] = Json::array();
    for (const RestPoint& r : fit.rests) {
        json["rests"].push_back({{"pivot_mm", json_triple(r.pivot_mm)},
                                 {"rms_mm", json_number(r.rms_mm)},
                                 {"first_frame", r.first_frame},
                                 {"last_frame", r.last_frame},
                                 {"poses", r.poses}});
    }
    Vector3 tip = fit.tip_mm;
    Vector3 sigma = fit.sigma_mm;
    if (refine && fit.determined) {
        if (fit.rests.size() > 1) {
            warnings.push_back(
                "Refinement needs a recording with one resting point; it was left out.");
        } else {
            const RefinePointResult refined = refine_point(poses, fit);
            json["refined"] = {{"tip_mm", json_triple(refined.tip_mm)},
                               {"sigma_mm", json_triple(refined.sigma_mm)},
                               {"rms_mm", json_number(refined.rms_mm)},
                               {"moved_mm", json_number(refined.moved_mm)},
                               {"converged", refined.converged}};
            if (refined.converged) {
                tip = refined.tip_mm;
                sigma = refined.sigma_mm;
            } else {
                warnings.push_back("The refinement did not converge; the linear answer was kept.");
            }
        }
    }
    json["warnings"] = warnings;
    json["residuals"] = json_residuals(fit.residuals);
    if (!options.pictures.empty()) {
        if (auto s = draw_point_pictures(poses, fit, options.pictures, "point"); !s)
            return fail("calibrate", s.error());
    }
    Calibration calibration;
    calibration.kind = "probe";
    calibration.sensor_from_tool.translation = tip;
    calibration.rms_mm = fit.rms_mm;
    calibration.sigma_mm = sigma;
    calibration.condition = fit.condition;
    calibration.poses = fit.inliers;
    calibration.data_digest = digest_of_poses(poses);
    const std::string people = text_line(
        "tip    (%.3f, %.3f, %.3f) mm in the sensor, one sigma (%.3f, %.3f, %.3f)\n"
        "pivot  (%.3f, %.3f, %.3f) mm in the tracker\n"
        "fit    %.3f mm rms, condition %.1f, %d of %d poses\n"
        "paper  d1 = %.3f mm, d2 = %.3f mm, theta = %.4f rad",
        tip.x, tip.y, tip.z, sigma.x, sigma.y, sigma.z, fit.pivot_mm.x, fit.pivot_mm.y,
        fit.pivot_mm.z, fit.rms_mm, fit.condition, fit.inliers, fit.poses, fit.d1_mm, fit.d2_mm,
        fit.theta_rad);
    return finish_calibration(options, json, people, calibration, fit.problem, warnings,
                              watch.seconds());
}

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
        json[name] = {{"direction", json_triple(fit.direction)},
                      {"sigma_deg", json_number(fit.sigma_rad / kDegree)},
                      {"rms_mm", json_number(fit.rms_mm)},
                      {"length_mm", json_number(fit.length_mm)},
                      {"turn_deg", json_number(fit.turn_rad / kDegree)},
                      {"condition", json_number(fit.condition)},
                      {"poses", fit.poses},
                      {"inliers", fit.inliers},
                      {"determined", fit.determined}};
        for (const std::string& w : fit.warnings) warnings.push_back(name + " sweep: " + w);
        if (!fit.determined && problem.empty()) problem = name + " sweep: " + fit.problem;
        people += text_line(
            "%-8s (%.4f, %.4f, %.4f) in the sensor, one sigma %.2f degrees, %.0f mm, %.2f mm rms\n",
            name.c_str(), fit.direction.x, fit.direction.y, fit.direction.z,
            fit.sigma_rad / kDegree, fit.length_mm, fit.rms_mm);
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
        json["raw_angle_deg"] = json_number(frame.raw_angle_rad / kDegree);
        json["sensor_from_probe"] = json_matrix(frame.sensor_from_probe);
        json["sigma_deg"] = json_number(frame.sigma_rad / kDegree);
        problem = frame.problem;
        warnings.insert(warnings.end(), frame.warnings.begin(), frame.warnings.end());
        people += text_line(
            "angle between the two as measured %.2f degrees; the frame is made orthonormal",
            frame.raw_angle_rad / kDegree);
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

int calibrate_needle(int argc, char** argv) {
    CLI::App app(
        "Find a needle's axis and tip from pivots through a pinhole at several depths, one "
        "recording each",
        "sonocase calibrate needle");
    CalibrateOptions options;
    options.add(app, 0);
    std::vector<double> depths;
    std::string spin;
    app.add_option("--depths", depths, "Distance from the hole to the tip for each recording, mm")
        ->delimiter(',')
        ->type_name("MM,MM,...");
    app.add_option("--spin", spin,
                   "Recording of the needle spun in a groove: compared with the pinholes")
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
    if (!recordings.empty()) {
        fit = fit_needle(recordings, how);
    } else {
        fit = turned;
    }
    std::vector<std::string> warnings = fit.warnings;
    Json json;
    json["direction"] = json_triple(fit.direction);
    json["tip_mm"] = json_triple(fit.tip_mm);
    json["axis_point_mm"] = json_triple(fit.axis_point_mm);
    json["tip_measured"] = fit.tip_measured;
    json["direction_sigma_deg"] = json_number(fit.direction_sigma_rad / kDegree);
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
    if (!spin.empty() && !recordings.empty()) {
        const NeedleAgreement same = compare(fit, turned);
        json["spin"] = {{"direction", json_triple(turned.direction)},
                        {"angle_deg", json_number(same.angle_rad / kDegree)},
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
        if (auto s = draw_needle_pictures(fit, options.pictures, "needle"); !s)
            return fail("calibrate", s.error());
        for (std::size_t k = 0; k < fit.points.size(); ++k) {
            if (auto s = draw_point_pictures(recordings[k], fit.points[k], options.pictures,
                                             "depth" + std::to_string(k + 1));
                !s) {
                return fail("calibrate", s.error());
            }
        }
    }
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
    calibration.data_digest = digest_of_poses(everything);
    const std::string people = text_line(
        "direction  (%.4f, %.4f, %.4f) in the sensor, one sigma %.2f degrees\n"
        "tip        (%.2f, %.2f, %.2f) mm in the sensor%s\n"
        "fit        %.2f mm rms, %d of %d poses",
        fit.direction.x, fit.direction.y, fit.direction.z, fit.direction_sigma_rad / kDegree,
        fit.tip_mm.x, fit.tip_mm.y, fit.tip_mm.z, fit.tip_measured ? "" : " (not measured)",
        fit.rms_mm, fit.inliers, fit.poses);
    return finish_calibration(options, json, people, calibration, fit.problem, warnings,
                              watch.seconds());
}

}  // namespace sonocase::pipeline
