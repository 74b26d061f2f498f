// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate point|direction|needle|mannequin|image|lag|camera|body
#include "pipeline/verbs/verb_calibrate.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <ctime>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>

#include "formats/calibration/pose_screen.h"
#include "formats/files/load_save.h"
#include "formats/recording/sequence.h"
#include "formats/recording/tool_frames.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

void CalibrateOptions::add(CLI::App& app, int min_recordings) {
    app.add_option(
           "--poses", poses,
           "Recordings: CSV (frame,timestamp_s,status,tx,ty,tz,r00..r22 or a quaternion), IGSIO "
           "sequence, or PerkTutor log")
        ->type_name("FILE")
        ->required(min_recordings > 0)
        ->expected(std::max(1, min_recordings), 1000);
    app.add_option("--reference", reference,
                   "Recording of a reference sensor, one for each of --poses or one for all: "
                   "poses are taken relative to it")
        ->type_name("FILE")
        ->expected(1, 1000);
    app.add_option("--transform", transform,
                   "Transform to take from a sequence, e.g. StylusToTracker");
    app.add_option("-o,--output", output, "Where to write the calibration")->type_name("CAL.json");
    app.add_option("--pictures", pictures, "Folder for pictures of residuals and coverage")
        ->type_name("DIR");
    app.add_option("--sensor", sensor, "Serial number or name of the sensor, kept in the file");
    app.add_option("--date", date, "Date to write, ISO 8601; default: now");
    app.add_flag("--json", json, "Print the result as JSON");
    add_common_options(app, common);
}

std::string CalibrateOptions::today() const {
    if (!date.empty()) return date;
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    gmtime_r(&now, &utc);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    return text;
}

Result<std::vector<Pose>> CalibrateOptions::load(const std::string& path) const {
    SONOCASE_TRY(const Sequence read, load_recording_file(path));
    int index = 0;
    if (!transform.empty()) {
        index = read.transform_index(transform);
        if (index < 0 && transform.ends_with("Transform")) {
            index = read.transform_index(transform.substr(0, transform.size() - 9));
        }
    } else if (read.transforms.size() != 1) {
        index = -1;
    }
    if (index < 0 || read.transforms.empty()) {
        std::string names;
        for (const std::string& n : read.transforms) names += (names.empty() ? "" : ", ") + n;
        return Error{transform.empty() ? "the sequence holds " +
                                             std::to_string(read.transforms.size()) + " transforms"
                                       : "the sequence has no transform " + transform,
                     path, "name one with --transform: " + (names.empty() ? "it has none" : names)};
    }
    for (const Message& note : read.notes)
        std::fprintf(stderr, "sonocase calibrate: note: %s\n", note.c_str());
    // Poor rotations are kept as read: screen_poses reports them.
    std::vector<Pose> found = poses_of(read, index);
    if (const std::string why = why_no_pose(read, index); !why.empty())
        return Error{
            "no pose of " + read.transforms[static_cast<std::size_t>(index)] + " counts: " + why,
            path, "expected rotations without scale or mirror, and status OK"};
    SONOCASE_TRY_DONE(check_places(found, path));
    return found;
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
    for (const auto& [poses_read, of] : {std::pair(&*tool, poses[k]), std::pair(&*base, path)}) {
        if (!has_times(*poses_read))
            return Error{"its readings have no times, or all the same", of,
                         "they are needed to find the reference's: record with time stamps"};
    }
    std::vector<Pose> relative = relative_poses(*base, *tool);
    if (relative.empty() && !tool->empty()) {
        return Error{"no reading of the reference is at the time of one of " + poses[k], path,
                     "both must be on one clock"};
    }
    return relative;
}

Result<std::vector<Pose>> CalibrateOptions::all_recordings() const {
    std::vector<Pose> all;
    for (std::size_t k = 0; k < poses.size(); ++k) {
        auto part = recording(k);
        if (!part) return part;
        all.insert(all.end(), part->begin(), part->end());
    }
    return all;
}

Json json_number(double v) {
    return std::isfinite(v) ? Json(v) : Json(nullptr);
}
Json json_triple(Vector3 v) {
    return Json::array({json_number(v.x), json_number(v.y), json_number(v.z)});
}
Json json_triple(Point3 v) {
    return Json::array({json_number(v.x), json_number(v.y), json_number(v.z)});
}
Json json_matrix(const Matrix3& m) {
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r)
        rows.push_back({json_number(m(r, 0)), json_number(m(r, 1)), json_number(m(r, 2))});
    return rows;
}

int finish_calibration(const CalibrateOptions& options,
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

std::string text_line(const char* format, ...) {
    char text[512];
    va_list list;
    va_start(list, format);
    std::vsnprintf(text, sizeof text, format, list);
    va_end(list);
    return text;
}

Json json_residuals(const std::vector<PoseResidual>& residuals) {
    Json list = Json::array();
    for (const PoseResidual& r : residuals) {
        list.push_back({{"frame", r.frame},
                        {"residual_mm", json_number(r.residual_mm)},
                        {"inlier", r.inlier}});
    }
    return list;
}

namespace {

struct SubVerb {
    const char* name;
    const char* summary;
    int (*run)(int argc, char** argv);
};
constexpr SubVerb kSubVerbs[] = {
    {"point", "tip of the probe or of a pointer, resting on a fixed point (pivot)",
     calibrate_point},
    {"direction", "the probe's axes, from a sweep along each", calibrate_direction},
    {"needle", "axis and tip of the needle: a pivot and a spin, or a pinhole at several depths",
     calibrate_needle},
    {"mannequin", "where the mannequin is, from landmarks or a sweep of its skin",
     calibrate_mannequin},
    {"image", "the image in the probe, from touches of both ends of the face", calibrate_image},
    {"lag", "how much later one recording shows a motion than another", calibrate_lag},
#ifdef SONOCASE_CAMERA
    {"camera", "a camera's lens, from a video of the printed board", calibrate_camera},
    {"body", "where a folded body's tags were glued, from a video of it turning", calibrate_body},
#endif
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
        std::fprintf(stderr, "sonocase calibrate: unknown kind \"%s\"\n", name.c_str());
    std::FILE* out = help ? stdout : stderr;
    std::fputs(
        "Usage: sonocase calibrate KIND --poses FILE.csv ... [-o CAL.json] [--json] [--pictures "
        "DIR]\n\n",
        out);
    for (const SubVerb& sub : kSubVerbs) std::fprintf(out, "  %-11s %s\n", sub.name, sub.summary);
    std::fputs("\nsonocase calibrate KIND --help    its options\n", out);
    return help ? kDone : kWrongUsage;
}

}  // namespace sonocase::pipeline::inline verbs
