// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate point: finds the tip of a tool that rests on a fixed point.
#include <CLI/CLI.hpp>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/calibration/point.h"
#include "formats/calibration/pose_screen.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/refine_point.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

Json json_of(const PointFit& fit) {
    Json json;
    json["tip_mm"] = json_triple(fit.tip_mm);
    json["pivot_mm"] = json_triple(fit.pivot_mm);
    json["rms_mm"] = json_number(fit.rms_mm);
    json["sigma_mm"] = json_triple(fit.sigma_mm);
    json["condition"] = json_number(fit.condition);
    json["poses"] = fit.poses;
    json["inliers"] = fit.inliers;
    json["left_out_shift_mm"] =
        fit.left_out_shift_mm < 0 ? Json(nullptr) : json_number(fit.left_out_shift_mm);
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["pivot_sigma_mm"] = json_triple(fit.pivot_sigma_mm);
    json["paper"] = {{"d1_mm", json_number(fit.d1_mm)},
                     {"d2_mm", json_number(fit.d2_mm)},
                     {"theta_rad", json_number(fit.theta_rad)}};
    json["weakest"] = {{"axis", json_triple(fit.weak_axis)},
                       {"sigma_mm", json_number(fit.weak_sigma_mm)}};
    json["swing_deg"] = json_triple(Vector3{std::asin(std::min(1.0, fit.swing.x)) / kRadPerDeg,
                                            std::asin(std::min(1.0, fit.swing.y)) / kRadPerDeg,
                                            std::asin(std::min(1.0, fit.swing.z)) / kRadPerDeg});
    json["correlation"] = json_number(fit.correlation);
    json["rests"] = Json::array();
    for (const RestPoint& r : fit.rests) {
        json["rests"].push_back({{"pivot_mm", json_triple(r.pivot_mm)},
                                 {"rms_mm", json_number(r.rms_mm)},
                                 {"first_frame", r.first_frame},
                                 {"last_frame", r.last_frame},
                                 {"poses", r.poses}});
    }
    return json;
}

// The tip and its sigma, refined if the fit allows it.
struct Tip {
    Vector3 tip, sigma;
};

Tip refined_tip(const std::vector<Pose>& poses,
                const PointFit& fit,
                Json& json,
                std::vector<std::string>& warnings) {
    if (fit.rests.size() > 1) {
        warnings.push_back("Refinement needs a recording with one resting point; it was left out.");
        return {fit.tip_mm, fit.sigma_mm};
    }
    const RefinePointResult refined = refine_point(poses, fit);
    json["refined"] = {{"tip_mm", json_triple(refined.tip_mm)},
                       {"sigma_mm", json_triple(refined.sigma_mm)},
                       {"rms_mm", json_number(refined.rms_mm)},
                       {"moved_mm", json_number(refined.moved_mm)},
                       {"converged", refined.converged}};
    if (refined.converged) return {refined.tip_mm, refined.sigma_mm};
    warnings.push_back("The refinement did not converge; the linear answer was kept.");
    return {fit.tip_mm, fit.sigma_mm};
}

std::string people_text(const PointFit& fit, Vector3 tip, Vector3 sigma) {
    std::string people = text_line(
        "tip    (%.3f, %.3f, %.3f) mm in the sensor, one sigma (%.3f, %.3f, %.3f)\n"
        "pivot  (%.3f, %.3f, %.3f) mm in the tracker\n"
        "fit    %.3f mm rms, condition %.1f, %d of %d poses\n"
        "paper  d1 = %.3f mm, d2 = %.3f mm, theta = %.4f rad",
        tip.x, tip.y, tip.z, sigma.x, sigma.y, sigma.z, fit.pivot_mm.x, fit.pivot_mm.y,
        fit.pivot_mm.z, fit.rms_mm, fit.condition, fit.inliers, fit.poses, fit.d1_mm, fit.d2_mm,
        fit.theta_rad);
    if (fit.inliers < fit.poses && fit.left_out_shift_mm >= 0) {
        people += text_line("\nleft out  %d poses; with them the tip would lie %.3f mm away",
                            fit.poses - fit.inliers, fit.left_out_shift_mm);
    }
    return people;
}

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
    auto read = options.all_recordings();
    if (!read) return fail("calibrate", read.error());
    const std::vector<Pose> poses = std::move(*read);
    PointOptions how;
    how.rests = rests == "one"       ? RestSearch::one
                : rests == "several" ? RestSearch::several
                                     : RestSearch::automatic;
    how.reject_outliers = !all;
    const PointFit fit = fit_point(poses, how);
    std::vector<std::string> warnings = fit.warnings;
    std::string problem = fit.problem;
    if (const std::string misread = misread_poses(poses, fit, how); !misread.empty())
        problem = problem.empty() ? misread : problem + "; " + misread;
    Json json = json_of(fit);
    Tip answer{fit.tip_mm, fit.sigma_mm};
    if (refine && fit.determined) answer = refined_tip(poses, fit, json, warnings);
    json["warnings"] = warnings;
    json["residuals"] = json_residuals(fit.residuals);
    if (!options.pictures.empty()) {
        if (auto s = draw_point_pictures(poses, fit, options.pictures, "point"); !s)
            return fail("calibrate", s.error());
    }
    Calibration calibration;
    calibration.kind = "probe";
    calibration.sensor_from_tool.translation = answer.tip;
    calibration.rms_mm = fit.rms_mm;
    calibration.sigma_mm = answer.sigma;
    calibration.condition = fit.condition;
    calibration.poses = fit.inliers;
    calibration.data_digest = digest_of_poses(poses);
    return finish_calibration(options, json, people_text(fit, answer.tip, answer.sigma),
                              calibration, problem, warnings, watch.seconds());
}

}  // namespace sonocase::pipeline::inline verbs
