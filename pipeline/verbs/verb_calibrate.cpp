// sonocase calibrate point|direction|needle|mannequin|image|lag
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/atomic_file.h"
#include "formats/calibrate/direction.h"
#include "formats/calibrate/image_plane.h"
#include "formats/calibrate/lag.h"
#include "formats/calibrate/landmarks.h"
#include "formats/calibrate/needle.h"
#include "formats/calibrate/point.h"
#include "formats/calibrate/pose_screen.h"
#include "formats/calibrate/quality.h"
#include "formats/calibration.h"
#include "formats/poses.h"
#include "formats/sequence.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/refine_point.h"
#include "pipeline/calibration/touched_points.h"
#include "pipeline/import/surface_file.h"
#include "pipeline/verbs/command_line.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline {
namespace {

using Json = nlohmann::ordered_json;
constexpr double kDegree = 3.14159265358979323846 / 180;

struct CalibrateOptions {
    CommonOptions common;
    std::vector<std::string> poses, reference;
    std::string transform, output, pictures, sensor, date;
    bool json = false;

    void add(CLI::App& app, int fewest) {
        app.add_option(
               "--poses", poses,
               "Recordings: CSV (frame,timestamp_s,status,tx,ty,tz,r00..r22) or IGSIO sequence")
            ->type_name("FILE")
            ->required(fewest > 0)
            ->expected(std::max(1, fewest), 1000);
        app.add_option("--reference", reference,
                       "Recording of a reference sensor, one for each of --poses or one for all: "
                       "poses are taken "
                       "relative to it")
            ->type_name("FILE")
            ->expected(1, 1000);
        app.add_option("--transform", transform,
                       "Transform to take from a sequence, e.g. StylusToTracker");
        app.add_option("-o,--output", output, "Where to write the calibration")
            ->type_name("CAL.json");
        app.add_option("--pictures", pictures, "Folder for pictures of residuals and coverage")
            ->type_name("DIR");
        app.add_option("--sensor", sensor, "Serial number or name of the sensor, kept in the file");
        app.add_option("--date", date, "Date to write, ISO 8601; default: now");
        app.add_flag("--json", json, "Print the result as JSON");
        add_common_options(app, common);
    }

    Result<std::vector<Pose>> load(const std::string& path) const;
    Result<std::vector<Pose>> recording(std::size_t k) const;
    std::string today() const {
        if (!date.empty()) return date;
        const std::time_t now = std::time(nullptr);
        std::tm utc{};
        gmtime_r(&now, &utc);
        char text[32];
        std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
        return text;
    }
};

Result<std::vector<Pose>> CalibrateOptions::load(const std::string& path) const {
    const bool sequence = path.ends_with(".mha") || path.ends_with(".nrrd");
    if (!sequence) return load_poses(path);
    auto read = load_sequence(path);
    if (!read) return read.error();
    int index = 0;
    if (!transform.empty()) {
        index = read->transform_index(transform);
        if (index < 0 && transform.ends_with("Transform")) {
            index = read->transform_index(transform.substr(0, transform.size() - 9));
        }
    } else if (read->transforms.size() != 1) {
        index = -1;
    }
    if (index < 0 || read->transforms.empty()) {
        std::string names;
        for (const std::string& n : read->transforms) names += (names.empty() ? "" : ", ") + n;
        return Error{transform.empty() ? "the sequence holds " +
                                             std::to_string(read->transforms.size()) + " transforms"
                                       : "the sequence has no transform " + transform,
                     path, "name one with --transform: " + (names.empty() ? "it has none" : names)};
    }
    std::vector<Pose> out;
    for (const SequenceFrame& frame : read->frames) {
        const SequencePose& given = frame.poses[static_cast<std::size_t>(index)];
        Pose pose;
        pose.frame = frame.number;
        pose.timestamp_s = frame.timestamp_s;
        pose.ok = given.ok;
        // Poor rotations are kept as read: the screen names them.
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
                pose.tracker_from_tool.rotation(r, c) =
                    given.to_from[static_cast<std::size_t>(4 * r + c)];
            }
            pose.tracker_from_tool.translation[r] =
                given.to_from[static_cast<std::size_t>(4 * r + 3)];
        }
        out.push_back(pose);
    }
    return out;
}

Result<std::vector<Pose>> CalibrateOptions::recording(std::size_t k) const {
    auto tool = load(poses[k]);
    if (!tool || reference.empty()) return tool;
    if (reference.size() != 1 && reference.size() != poses.size()) {
        return Error{std::to_string(reference.size()) + " references for " +
                         std::to_string(poses.size()) + " recordings",
                     "--reference", "give one, or one for each"};
    }
    const std::string& path = reference[reference.size() == 1 ? 0 : k];
    auto base = load(path);
    if (!base) return base;
    std::vector<Pose> relative = relative_poses(*base, *tool);
    if (relative.empty() && !tool->empty()) {
        return Error{"no reading of the reference is at the time of one of " + poses[k], path,
                     "both must be on one clock"};
    }
    return relative;
}

Json number(double v) {
    return std::isfinite(v) ? Json(v) : Json(nullptr);
}
Json triple(Vector3 v) {
    return Json::array({number(v.x), number(v.y), number(v.z)});
}
Json triple(Point3 v) {
    return Json::array({number(v.x), number(v.y), number(v.z)});
}
Json matrix(const Matrix3& m) {
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r) rows.push_back({number(m(r, 0)), number(m(r, 1)), number(m(r, 2))});
    return rows;
}

// Prints, draws and saves what a sub-verb found; the last word on whether it worked.
int finish(const CalibrateOptions& options,
           const Json& result,
           const std::string& people,
           Calibration calibration,
           const std::string& problem,
           const std::vector<std::string>& warnings,
           double seconds) {
    StageReport report;
    report.stage = "calibrate";
    report.seconds = seconds;
    report.warnings = warnings;
    for (const auto& [name, value] : result.items()) {
        if (value.is_number()) report.measures.push_back({name, value.get<double>()});
    }
    if (options.json) {
        std::printf("%s\n", result.dump(2).c_str());
    } else if (problem.empty()) {
        std::printf("%s\n", people.c_str());
    }
    for (const std::string& w : warnings)
        std::fprintf(stderr, "sonocase calibrate: warning: %s\n", w.c_str());
    if (auto s = write_report(options.common, report); !s) return fail("calibrate", s.error());
    if (!problem.empty()) {
        return fail("calibrate", {problem, options.poses.empty() ? "" : options.poses[0], ""});
    }
    if (!options.output.empty()) {
        calibration.sensor = options.sensor;
        calibration.date = options.today();
        calibration.warnings = warnings;
        if (auto s = save_calibration(calibration, options.output); !s)
            return fail("calibrate", s.error());
    }
    return kDone;
}

std::string line(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string line(const char* format, ...) {
    char text[512];
    va_list list;
    va_start(list, format);
    std::vsnprintf(text, sizeof text, format, list);
    va_end(list);
    return text;
}

Json residual_list(const std::vector<PoseResidual>& residuals) {
    Json list = Json::array();
    for (const PoseResidual& r : residuals) {
        list.push_back(
            {{"frame", r.frame}, {"residual_mm", number(r.residual_mm)}, {"inlier", r.inlier}});
    }
    return list;
}

int run_point(int argc, char** argv) {
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
    json["tip_mm"] = triple(fit.tip_mm);
    json["pivot_mm"] = triple(fit.pivot_mm);
    json["rms_mm"] = number(fit.rms_mm);
    json["sigma_mm"] = triple(fit.sigma_mm);
    json["condition"] = number(fit.condition);
    json["poses"] = fit.poses;
    json["inliers"] = fit.inliers;
    std::vector<std::string> warnings = fit.warnings;
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["pivot_sigma_mm"] = triple(fit.pivot_sigma_mm);
    json["paper"] = {{"d1_mm", number(fit.d1_mm)},
                     {"d2_mm", number(fit.d2_mm)},
                     {"theta_rad", number(fit.theta_rad)}};
    json["weakest"] = {{"axis", triple(fit.weak_axis)}, {"sigma_mm", number(fit.weak_sigma_mm)}};
    json["swing_deg"] = triple(Vector3{std::asin(std::min(1.0, fit.swing.x)) / kDegree,
                                       std::asin(std::min(1.0, fit.swing.y)) / kDegree,
                                       std::asin(std::min(1.0, fit.swing.z)) / kDegree});
    json["correlation"] = number(fit.correlation);
    json["rests"] = Json::array();
    for (const RestPoint& r : fit.rests) {
        json["rests"].push_back({{"pivot_mm", triple(r.pivot_mm)},
                                 {"rms_mm", number(r.rms_mm)},
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
            json["refined"] = {{"tip_mm", triple(refined.tip_mm)},
                               {"sigma_mm", triple(refined.sigma_mm)},
                               {"rms_mm", number(refined.rms_mm)},
                               {"moved_mm", number(refined.moved_mm)},
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
    json["residuals"] = residual_list(fit.residuals);
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
    const std::string people = line(
        "tip    (%.3f, %.3f, %.3f) mm in the sensor, one sigma (%.3f, %.3f, %.3f)\n"
        "pivot  (%.3f, %.3f, %.3f) mm in the tracker\n"
        "fit    %.3f mm rms, condition %.1f, %d of %d poses\n"
        "paper  d1 = %.3f mm, d2 = %.3f mm, theta = %.4f rad",
        tip.x, tip.y, tip.z, sigma.x, sigma.y, sigma.z, fit.pivot_mm.x, fit.pivot_mm.y,
        fit.pivot_mm.z, fit.rms_mm, fit.condition, fit.inliers, fit.poses, fit.d1_mm, fit.d2_mm,
        fit.theta_rad);
    return finish(options, json, people, calibration, fit.problem, warnings, watch.seconds());
}

int run_direction(int argc, char** argv) {
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
        json[name] = {{"direction", triple(fit.direction)},
                      {"sigma_deg", number(fit.sigma_rad / kDegree)},
                      {"rms_mm", number(fit.rms_mm)},
                      {"length_mm", number(fit.length_mm)},
                      {"turn_deg", number(fit.turn_rad / kDegree)},
                      {"condition", number(fit.condition)},
                      {"poses", fit.poses},
                      {"inliers", fit.inliers},
                      {"determined", fit.determined}};
        for (const std::string& w : fit.warnings) warnings.push_back(name + " sweep: " + w);
        if (!fit.determined && problem.empty()) problem = name + " sweep: " + fit.problem;
        people += line(
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
        json["raw_angle_deg"] = number(frame.raw_angle_rad / kDegree);
        json["sensor_from_probe"] = matrix(frame.sensor_from_probe);
        json["sigma_deg"] = number(frame.sigma_rad / kDegree);
        problem = frame.problem;
        warnings.insert(warnings.end(), frame.warnings.begin(), frame.warnings.end());
        people +=
            line("angle between the two as measured %.2f degrees; the frame is made orthonormal",
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
    return finish(options, json, people, calibration, problem, warnings, watch.seconds());
}

int run_needle(int argc, char** argv) {
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
    json["direction"] = triple(fit.direction);
    json["tip_mm"] = triple(fit.tip_mm);
    json["axis_point_mm"] = triple(fit.axis_point_mm);
    json["tip_measured"] = fit.tip_measured;
    json["direction_sigma_deg"] = number(fit.direction_sigma_rad / kDegree);
    json["tip_sigma_mm"] = triple(fit.tip_sigma_mm);
    json["rms_mm"] = number(fit.rms_mm);
    json["condition"] = number(fit.condition);
    json["poses"] = fit.poses;
    json["inliers"] = fit.inliers;
    json["paper"] = {{"direction", triple(fit.paper_direction)},
                     {"point_mm", triple(fit.paper_point_mm)}};
    json["depths"] = Json::array();
    for (const PointFit& p : fit.points) {
        json["depths"].push_back({{"point_mm", triple(p.tip_mm)},
                                  {"sigma_mm", triple(p.sigma_mm)},
                                  {"rms_mm", number(p.rms_mm)},
                                  {"poses", p.poses},
                                  {"inliers", p.inliers},
                                  {"determined", p.determined}});
    }
    if (!spin.empty() && !recordings.empty()) {
        const NeedleAgreement same = compare(fit, turned);
        json["spin"] = {{"direction", triple(turned.direction)},
                        {"angle_deg", number(same.angle_rad / kDegree)},
                        {"distance_mm", number(same.distance_mm)},
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
    const std::string people = line(
        "direction  (%.4f, %.4f, %.4f) in the sensor, one sigma %.2f degrees\n"
        "tip        (%.2f, %.2f, %.2f) mm in the sensor%s\n"
        "fit        %.2f mm rms, %d of %d poses",
        fit.direction.x, fit.direction.y, fit.direction.z, fit.direction_sigma_rad / kDegree,
        fit.tip_mm.x, fit.tip_mm.y, fit.tip_mm.z, fit.tip_measured ? "" : " (not measured)",
        fit.rms_mm, fit.inliers, fit.poses);
    return finish(options, json, people, calibration, fit.problem, warnings, watch.seconds());
}

int run_mannequin(int argc, char** argv) {
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
    json["world_from_mannequin"] = {{"rotation", matrix(fit.to_from.rotation)},
                                    {"translation_mm", triple(fit.to_from.translation)},
                                    {"scale", number(fit.scale)}};
    json["rms_mm"] = number(fit.rms_mm);
    json["sigma_mm"] = triple(fit.sigma_mm);
    json["sigma_deg"] = triple(fit.sigma_rad / kDegree);
    json["scale_seen"] = number(fit.scale_seen);
    json["condition"] = number(fit.condition);
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
    const std::string people = line(
        "world_from_mannequin  turn %.2f degrees, shift (%.2f, %.2f, %.2f) mm, scale %.4f\n"
        "fit                   %.2f mm rms, %d of %d points, one sigma (%.2f, %.2f, %.2f) mm",
        rotation_angle(fit.to_from.rotation) / kDegree, fit.to_from.translation.x,
        fit.to_from.translation.y, fit.to_from.translation.z, fit.scale, fit.rms_mm, fit.inliers,
        fit.points, fit.sigma_mm.x, fit.sigma_mm.y, fit.sigma_mm.z);
    return finish(options, json, people, calibration, fit.problem, warnings, watch.seconds());
}

int run_image(int argc, char** argv) {
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
    json["sensor_from_probe"] = {{"rotation", matrix(plane.sensor_from_probe.rotation)},
                                 {"translation_mm", triple(plane.sensor_from_probe.translation)}};
    json["footprint_mm"] = number(plane.footprint_mm);
    json["mm_per_px"] = number(plane.mm_per_px);
    json["middle_px"] = {number(plane.u0), number(plane.v0)};
    json["lateral_sign"] = plane.lateral_sign;
    json["mirrored"] = plane.mirrored;
    json["upside_down"] = plane.upside_down;
    json["face_angle_deg"] = number(plane.face_angle_rad / kDegree);
    json["off_plane_mm"] = number(plane.off_plane_mm);
    json["rms_mm"] = number(plane.rms_mm);
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
        line("face %.1f mm wide, %.4f mm a pixel, mark on the %s%s", plane.footprint_mm,
             plane.mm_per_px, input.mark_on_left ? "left" : "right",
             plane.mirrored ? "; the frame was mirrored and is turned round" : "");
    return finish(options, json, people, calibration, plane.problem, plane.warnings,
                  watch.seconds());
}

int run_lag(int argc, char** argv) {
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
    json["lag_s"] = number(fit.lag_s);
    json["sigma_s"] = number(fit.sigma_s);
    json["correlation"] = number(fit.correlation);
    json["overlap_s"] = number(fit.overlap_s);
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
                     {"lag_s", number(fit.lag_s)},
                     {"sigma_s", number(fit.sigma_s)},
                     {"correlation", number(fit.correlation)},
                     {"date", options.today()},
                     {"sensor", options.sensor},
                     {"warnings", fit.warnings}};
        if (auto s = write_file(options.output, std::string_view(file.dump(2) + "\n")); !s)
            return fail("calibrate", s.error());
        options.output.clear();
    }
    const std::string people =
        line("the second is %.1f ms later than the first, one sigma %.1f ms, correlation %.3f",
             1e3 * fit.lag_s, 1e3 * fit.sigma_s, fit.correlation);
    return finish(options, json, people, {}, fit.problem, fit.warnings, watch.seconds());
}

struct SubVerb {
    const char* name;
    const char* summary;
    int (*run)(int argc, char** argv);
};
constexpr SubVerb kSubVerbs[] = {
    {"point", "tip of the probe or of a pointer, resting on a fixed point (pivot)", run_point},
    {"direction", "the probe's axes, from a sweep along each", run_direction},
    {"needle", "axis and tip of the needle, through a pinhole at several depths", run_needle},
    {"mannequin", "where the mannequin stands, from landmarks or a sweep of its skin",
     run_mannequin},
    {"image", "the image in the probe, from touches of both ends of the face", run_image},
    {"lag", "how much later one recording shows a motion than another", run_lag},
};

}  // namespace

int verb_calibrate(int argc, char** argv) {
    const std::string name = argc > 1 ? argv[1] : "";
    for (const SubVerb& sub : kSubVerbs) {
        if (name != sub.name) continue;
        std::string full = "calibrate " + name;  // as messages and help name it
        argv[1] = full.data();
        return sub.run(argc - 1, argv + 1);
    }
    const bool help = name == "--help" || name == "-h" || name == "help";
    if (!help && !name.empty())
        std::fprintf(stderr, "sonocase calibrate: there is no \"%s\"\n", name.c_str());
    std::FILE* out = help ? stdout : stderr;
    std::fputs(
        "Usage: sonocase calibrate KIND --poses FILE.csv ... [-o CAL.json] [--json] [--pictures "
        "DIR]\n\n",
        out);
    for (const SubVerb& sub : kSubVerbs) std::fprintf(out, "  %-11s %s\n", sub.name, sub.summary);
    std::fputs("\nsonocase calibrate KIND --help    its options\n", out);
    return help ? kDone : kWrongUsage;
}

}  // namespace sonocase::pipeline
