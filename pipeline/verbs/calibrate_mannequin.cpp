// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate mannequin: finds where the mannequin is, from landmarks or a sweep of its
// skin.
#include <CLI/CLI.hpp>
#include <algorithm>

#include "formats/base/constants.h"
#include "formats/calibration/calibration.h"
#include "formats/calibration/landmarks.h"
#include "formats/calibration/pose_screen.h"
#include "formats/files/load_save.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/touched_points.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct MannequinOptions {
    CalibrateOptions common;
    std::string landmarks, touched, surface, tool, start, axes = "file";
    bool scale = false;
};

void add_options(CLI::App& app, MannequinOptions& m) {
    m.common.add(app, 0);
    app.add_option("--landmarks", m.landmarks,
                   "Where they are on the mannequin: rows name,x,y,z (mannequin frame)")
        ->type_name("FILE.csv");
    app.add_option("--touched", m.touched,
                   "Where they were touched: rows name,x,y,z (world frame); instead, --poses with "
                   "--tool: the rests of the tip, in the order of the "
                   "landmarks")
        ->type_name("FILE.csv");
    app.add_option("--surface", m.surface,
                   "Mannequin's surface, to lay a sweep of --poses or --touched on")
        ->type_name("FILE");
    app.add_option("--tool", m.tool, "Calibration of the tool that touched")->type_name("CAL.json");
    app.add_option("--start", m.start,
                   "Earlier calibration of this mannequin to start the sweep from")
        ->type_name("CAL.json");
    app.add_option("--axes", m.axes, "Axes of the surface file's coordinates, whatever it says")
        ->check(CLI::IsMember({"file", "ras", "lps"}))
        ->capture_default_str();
    app.add_flag("--scale", m.scale, "Allow one uniform scale");
}

// Points on the mannequin in the world frame, as touched or swept.
struct Readings {
    NamedPoints world;
    std::string digest;
    std::vector<std::string> warnings;
};

Result<Readings> read_touches(const MannequinOptions& m) {
    Readings out;
    if (!m.touched.empty()) {
        SONOCASE_TRY(auto read, load_named_points(m.touched));
        out.world = std::move(read);
        out.digest = digest_of_points(out.world.points);
        return out;
    }
    SONOCASE_TRY(auto held, load_calibration(m.tool));
    for (const std::string& c : calibration_concerns(held, m.common.today()))
        out.warnings.push_back(c);
    SONOCASE_TRY(auto poses, m.common.all_recordings());
    PoseScreen screen = screen_poses(poses);
    out.warnings.insert(out.warnings.end(), screen.warnings.begin(), screen.warnings.end());
    const Vector3 tip = held.sensor_from_tool.translation;
    if (!m.surface.empty()) {
        out.world.points = tip_trace(screen.poses, tip);
    } else {
        for (const RestPoint& r : find_rests(screen.poses, tip))
            out.world.points.push_back(r.pivot_mm);
    }
    out.digest = digest_of_poses(poses);
    return out;
}

// The pose of the mannequin and the points that it was fitted to, for the pictures.
struct PosedMannequin {
    RigidFit fit;
    std::vector<Point3> known, world;  // mannequin and world frame
};

Result<PosedMannequin> fit_landmarks(const MannequinOptions& m, const NamedPoints& world) {
    SONOCASE_TRY(auto known, load_named_points(m.landmarks));
    // Points are paired by name if both lists have names, else by order.
    auto paired = pair_points(known, world);
    if (!paired) {
        Error e = paired.error();
        e.where = m.touched.empty() ? m.common.poses[0] : m.touched;
        return e;
    }
    const auto& [on_mannequin, in_world] = *paired;
    return PosedMannequin{
        fit_rigid(on_mannequin.points, in_world.points, on_mannequin.names, {.fit_scale = m.scale}),
        on_mannequin.points, in_world.points};
}

Result<PosedMannequin> fit_sweep(const MannequinOptions& m, const NamedPoints& world) {
    SONOCASE_TRY(auto skin, import_surface(m.surface, {.axes = axes_named(m.axes)}));
    SweepOptions how;
    how.fit_scale = m.scale;
    if (!m.start.empty()) {
        SONOCASE_TRY(auto before, load_calibration(m.start));
        how.has_start = true;
        how.start = before.sensor_from_tool;
    }
    // Successive readings carry the same information: 1,500 are plenty.
    std::vector<Point3> thin;
    const std::size_t stride = std::max<std::size_t>(1, world.points.size() / 1500);
    for (std::size_t i = 0; i < world.points.size(); i += stride) thin.push_back(world.points[i]);
    RigidFit fit = fit_skin_sweep(skin, thin, how);
    return PosedMannequin{std::move(fit), std::move(skin.points), std::move(thin)};
}

Json json_of(const RigidFit& fit, const std::vector<std::string>& warnings) {
    Json json;
    json["world_from_mannequin"] = {{"rotation", json_matrix(fit.to_from.rotation)},
                                    {"translation_mm", json_triple(fit.to_from.translation)},
                                    {"scale", json_number(fit.scale)}};
    json["rms_mm"] = json_number(fit.rms_mm);
    json["sigma_mm"] = json_triple(fit.sigma_mm);
    json["sigma_deg"] = json_triple(fit.sigma_rad / kRadPerDeg);
    json["scale_seen"] = json_number(fit.scale_seen);
    json["condition"] = json_number(fit.condition);
    json["points"] = fit.points;
    json["inliers"] = fit.inliers;
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["warnings"] = warnings;
    json["residuals_mm"] = fit.residuals_mm;
    return json;
}

Calibration calibration_of(const RigidFit& fit) {
    Calibration calibration;
    calibration.kind = "mannequin";
    calibration.sensor_from_tool = fit.to_from;
    calibration.scale = fit.scale;
    calibration.rms_mm = fit.rms_mm;
    calibration.sigma_mm = fit.sigma_mm;
    calibration.condition = fit.condition;
    calibration.poses = fit.inliers;
    return calibration;
}

std::string people_text(const RigidFit& fit) {
    return text_line(
        "world_from_mannequin  turn %.2f degrees, shift (%.2f, %.2f, %.2f) mm, scale %.4f\n"
        "fit                   %.2f mm rms, %d of %d points, one sigma (%.2f, %.2f, %.2f) mm",
        rotation_angle(fit.to_from.rotation) / kRadPerDeg, fit.to_from.translation.x,
        fit.to_from.translation.y, fit.to_from.translation.z, fit.scale, fit.rms_mm, fit.inliers,
        fit.points, fit.sigma_mm.x, fit.sigma_mm.y, fit.sigma_mm.z);
}

}  // namespace

int calibrate_mannequin(int argc, char** argv) {
    CLI::App app(
        "Find where the mannequin is today, from landmarks touched on it or a sweep of its skin",
        "sonocase calibrate mannequin");
    MannequinOptions m;
    add_options(app, m);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (m.landmarks.empty() && m.surface.empty())
        return wrong_usage("calibrate", "give --landmarks or --surface");
    if (m.touched.empty() && m.common.poses.empty())
        return wrong_usage("calibrate", "give --touched or --poses with --tool");
    if (!m.common.poses.empty() && m.tool.empty())
        return wrong_usage("calibrate", "--poses needs --tool CAL.json");

    auto readings = read_touches(m);
    if (!readings) return fail("calibrate", readings.error());
    auto posed =
        m.surface.empty() ? fit_landmarks(m, readings->world) : fit_sweep(m, readings->world);
    if (!posed) return fail("calibrate", posed.error());
    const RigidFit& fit = posed->fit;
    std::vector<std::string> warnings = std::move(readings->warnings);
    warnings.insert(warnings.end(), fit.warnings.begin(), fit.warnings.end());
    if (!m.common.pictures.empty() && fit.determined) {
        if (auto s = draw_rigid_pictures(posed->known, posed->world, fit, m.common.pictures,
                                         "mannequin");
            !s) {
            return fail("calibrate", s.error());
        }
    }
    Calibration calibration = calibration_of(fit);
    calibration.data_digest = readings->digest;
    return finish_calibration(m.common, json_of(fit, warnings), people_text(fit), calibration,
                              fit.problem, warnings, watch.seconds());
}

}  // namespace sonocase::pipeline::inline verbs
