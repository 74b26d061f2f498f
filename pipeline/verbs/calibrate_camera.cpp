// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate camera and body: a camera's lens, from a video in which the printed board is
// turned; and where a body's tags were glued, from one in which the body is.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ctime>

#include "formats/files/atomic_file.h"
#include "formats/files/jpeg_video.h"
#include "formats/markers/camera_model.h"
#include "formats/markers/detect/grey_jpeg.h"
#include "formats/markers/detect/tag_detector.h"
#include "pipeline/calibration/body_fit.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct MarkerFilm {
    std::vector<MarkerView> views;
    int width_px = 0, height_px = 0, pictures = 0, damaged = 0;
};

// The pictures in which min_tags of a body or board are seen, evenly thinned out.
Result<MarkerFilm> look_at(const std::string& path,
                           const MarkerBody& body,
                           std::size_t min_tags,
                           int max_views) {
    SONOCASE_TRY(const JpegVideo video, load_jpeg_video(path));
    SONOCASE_TRY(GreyJpegReader reader, GreyJpegReader::create());
    SONOCASE_TRY(TagDetector detector, TagDetector::create());
    MarkerFilm out;
    out.pictures = static_cast<int>(video.pictures.size());
    GreyImage picture;
    // Successive pictures of a video say much the same.
    const std::size_t every = std::max<std::size_t>(1, video.pictures.size() / (4 * max_views));
    std::vector<MarkerView> views;
    for (std::size_t i = 0; i < video.pictures.size(); i += every) {
        if (!reader.read(video.pictures[i], picture)) {
            ++out.damaged;
            continue;
        }
        if (out.width_px == 0) out.width_px = picture.width_px, out.height_px = picture.height_px;
        if (picture.width_px != out.width_px || picture.height_px != out.height_px)
            return Error{"the size of the pictures changes", path, "use pictures of one size"};
        TagFindings found = detector.find(
            {picture.pixels.data(), picture.width_px, picture.height_px, picture.width_px});
        MarkerView view;
        view.picture = static_cast<int>(i);
        for (SeenTag& tag : found.tags)
            for (const MarkerTag& drawn : body.tags)
                if (drawn.id == tag.id) view.tags.push_back(tag);
        if (view.tags.size() >= min_tags) views.push_back(std::move(view));
    }
    const std::size_t thin = (views.size() + max_views - 1) / max_views;
    for (std::size_t k = 0; k < views.size(); k += std::max<std::size_t>(1, thin))
        out.views.push_back(std::move(views[k]));
    return out;
}

std::string coverage_text(const CameraFit& fit) {
    std::string text = "corners seen in each part of the picture:\n";
    for (const auto& row : fit.fields) {
        for (const int count : row) text += text_line(" %5d", count);
        text += "\n";
    }
    return text;
}

}  // namespace

int calibrate_camera(int argc, char** argv) {
    CLI::App app(
        "Find a camera's focal lengths, middle and distortion from a video in which the printed "
        "board "
        "(sonocase markers) is moved through the whole picture and tilted to all sides",
        "sonocase calibrate camera");
    CommonOptions common;
    CameraSetup setup;
    std::string video, output, camera, date;
    bool json = false;
    int max_views = 60;
    app.add_option("--video", video,
                   "AVI of JPEG pictures (MJPG), such pictures one after another, or a folder of "
                   ".jpg files")
        ->type_name("VIDEO")
        ->required();
    app.add_option("-o,--output", output, "Where to write the camera for the player")
        ->type_name("CAMERA.json");
    const CLI::Option* ruler =
        app.add_option("--ruler", setup.markers.ruler_mm, "Length of the printed ruler, mm")
            ->capture_default_str();
    app.add_option("--body", setup.markers.body_mm, "Size of the bodies as printed, mm")
        ->capture_default_str();
    app.add_option("--probe-reach", setup.markers.probe_reach_mm,
                   "From the middle of the body to the probe's face, mm")
        ->capture_default_str();
    app.add_option("--needle-reach", setup.markers.needle_reach_mm,
                   "From the middle of the body to the needle's tip, mm")
        ->capture_default_str();
    app.add_option("--board-tag", setup.markers.board_tag_mm, "Edge of a tag of the board, mm")
        ->capture_default_str();
    app.add_option("--max-views", max_views, "No more pictures are used")
        ->check(CLI::Range(8, 400))
        ->capture_default_str();
    app.add_option("--camera", camera, "Name of the camera, kept in the file");
    app.add_option("--date", date, "Date to write, ISO 8601; default: now");
    app.add_flag("--json", json, "Print the result as JSON");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (auto s = check_marker_sizes(setup.markers); !s) return fail("calibrate", s.error());
    const MarkerBody board = marker_bodies(setup.markers).back();
    const auto seen = look_at(video, board, 3, max_views);
    if (!seen) return fail("calibrate", seen.error());
    const CameraFit fit = fit_camera(seen->views, board, seen->width_px, seen->height_px);
    const CameraModel& c = fit.camera;
    if (json) {
        Json out;
        out["width_px"] = c.width_px;
        out["height_px"] = c.height_px;
        out["focal_px"] = {json_number(c.fx_px), json_number(c.fy_px)};
        out["middle_px"] = {json_number(c.cx_px), json_number(c.cy_px)};
        out["distortion"] = {c.k1, c.k2, c.p1, c.p2, c.k3};
        out["rms_px"] = json_number(c.rms_px);
        out["worst_view_px"] = json_number(fit.worst_view_px);
        out["sigma_px"] = {json_number(fit.sigma_px[0]), json_number(fit.sigma_px[1]),
                           json_number(fit.sigma_px[2]), json_number(fit.sigma_px[3])};
        out["tilt_deg"] = json_number(fit.tilt_deg);
        out["coverage"] = fit.coverage;
        out["views"] = fit.views;
        out["pictures"] = seen->pictures;
        out["corners"] = fit.corners;
        out["warnings"] = fit.warnings;
        out["determined"] = fit.problem.empty();
        out["problem"] = fit.problem;
        std::printf("%s\n", out.dump(2).c_str());
    } else if (fit.corners > 0) {
        std::printf(
            "focal length %.1f x %.1f px, one sigma %.1f; middle %.1f, %.1f; corners off by %.2f "
            "px "
            "rms in %d pictures, tilted by %.0f degrees\n%s",
            c.fx_px, c.fy_px, fit.sigma_px[0], c.cx_px, c.cy_px, c.rms_px, fit.views, fit.tilt_deg,
            coverage_text(fit).c_str());
    }
    StageReport report;
    report.stage = "calibrate camera";
    report.seconds = watch.seconds();
    report.measures = {{"views", static_cast<double>(fit.views)},
                       {"rms_px", c.rms_px},
                       {"coverage", fit.coverage},
                       {"tilt_deg", fit.tilt_deg}};
    report.warnings.assign(fit.warnings.begin(), fit.warnings.end());
    constexpr double kSlipMm = 0.5;  // of a hand that measures 100 mm
    if (std::abs(setup.markers.ruler_mm - 100) > kSlipMm)
        report.warnings.push_back(text_line(
            "The sheets are printed at %.1f %% of their size, which is reckoned with: cut from "
            "sheets that came out of the printer together, and keep to this file.",
            setup.markers.ruler_mm));
    print_warnings("calibrate", report);
    if (auto s = write_report(common, report); !s) return fail("calibrate", s.error());
    if (!fit.problem.empty()) return fail("calibrate", {fit.problem, video, ""});
    // No picture tells the scale of a print: all of it would lie farther away.
    if (ruler->count() == 0)
        std::fprintf(stderr,
                     "sonocase calibrate: note: the printed ruler is taken to be 100 mm long: "
                     "measure it, and say --ruler where it is not\n");
    if (!output.empty()) {
        setup.camera = c;
        setup.camera.camera = camera;
        CalibrateOptions when;
        when.date = date;
        setup.camera.date = when.today();
        if (auto s = write_file(output, format_camera(setup)); !s)
            return fail("calibrate", s.error());
    }
    return kDone;
}

int calibrate_body(int argc, char** argv) {
    CLI::App app(
        "Find where the tags of a folded body were glued, from a video in which the body is turned "
        "slowly to all sides",
        "sonocase calibrate body");
    CommonOptions common;
    std::string video, camera, output, tool = "probe";
    bool json = false;
    int max_views = 90;
    app.add_option("--video", video,
                   "AVI of JPEG pictures (MJPG), such pictures one after another, or a folder of "
                   ".jpg files")
        ->type_name("VIDEO")
        ->required();
    app.add_option("--camera", camera, "The camera, as sonocase calibrate camera wrote it")
        ->type_name("CAMERA.json")
        ->required();
    app.add_option("--tool", tool, "Whose body it is")
        ->check(CLI::IsMember({"probe", "needle"}))
        ->capture_default_str();
    app.add_option("-o,--output", output,
                   "Where to write the camera with the body as built; may be CAMERA.json itself")
        ->type_name("CAMERA.json");
    app.add_option("--max-views", max_views, "No more pictures are used")
        ->check(CLI::Range(15, 400))
        ->capture_default_str();
    app.add_flag("--json", json, "Print the result as JSON");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    const auto text = read_text_file(camera);
    if (!text) return fail("calibrate", text.error());
    auto setup = parse_camera(*text, camera);
    if (!setup) return fail("calibrate", setup.error());
    const std::vector<MarkerBody> bodies = marker_bodies(setup->markers);
    const MarkerBody& drawn = bodies[tool == "probe" ? 0 : 1];
    auto seen = look_at(video, drawn, 2, max_views);
    if (!seen) return fail("calibrate", seen.error());
    BodyFit fit;
    if (seen->views.empty()) {
        fit.problem = "no picture shows two tags of the " + tool + "'s body";
    } else {
        const auto lens = at_size(setup->camera, seen->width_px, seen->height_px);
        if (!lens) return fail("calibrate", lens.error());
        for (MarkerView& view : seen->views)
            for (SeenTag& tag : view.tags) unbend_tag(*lens, tag);
        fit = fit_body(seen->views, drawn, *lens);
    }
    if (json) {
        Json out;
        out["views"] = fit.views;
        out["pictures"] = seen->pictures;
        out["drawn_rms_px"] = json_number(fit.drawn_rms_px);
        out["rms_px"] = json_number(fit.rms_px);
        out["tags"] = Json::array();
        for (const TagOfBody& tag : fit.tags)
            out["tags"].push_back({{"id", tag.built.id},
                                   {"sights", tag.sights},
                                   {"moved_mm", json_triple(tag.built.moved_mm)},
                                   {"turned_rad", json_triple(tag.built.turned_rad)},
                                   {"sigma_mm", json_number(tag.sigma_mm)},
                                   {"sigma_deg", json_number(tag.sigma_deg)}});
        out["warnings"] = fit.warnings;
        out["determined"] = fit.problem.empty();
        out["problem"] = fit.problem;
        std::printf("%s\n", out.dump(2).c_str());
    } else if (fit.rms_px >= 0) {
        std::printf("corners off by %.2f px rms as drawn, %.2f as built, in %d pictures\n",
                    fit.drawn_rms_px, fit.rms_px, fit.views);
        for (const TagOfBody& tag : fit.tags)
            std::printf(
                "tag %d: %.2f mm and %.2f degrees from where it is drawn, one sigma %.2f mm and "
                "%.2f degrees, in %d pictures\n",
                tag.built.id, norm(tag.built.moved_mm), kDegPerRad * norm(tag.built.turned_rad),
                tag.sigma_mm, tag.sigma_deg, tag.sights);
    }
    StageReport report;
    report.stage = "calibrate body";
    report.seconds = watch.seconds();
    report.measures = {{"views", static_cast<double>(fit.views)},
                       {"drawn_rms_px", fit.drawn_rms_px},
                       {"rms_px", fit.rms_px},
                       {"worst_moved_mm", fit.worst_moved_mm},
                       {"worst_turned_deg", fit.worst_turned_deg}};
    report.warnings.assign(fit.warnings.begin(), fit.warnings.end());
    print_warnings("calibrate", report);
    if (auto s = write_report(common, report); !s) return fail("calibrate", s.error());
    if (!fit.problem.empty()) return fail("calibrate", {fit.problem, video, ""});
    if (!output.empty()) {
        std::vector<BuiltTag>& built = setup->built;
        built.erase(std::remove_if(
                        built.begin(), built.end(),
                        [&](const BuiltTag& tag) { return find_tag({drawn}, tag.id).body == 0; }),
                    built.end());
        for (const TagOfBody& tag : fit.tags) built.push_back(tag.built);
        std::sort(built.begin(), built.end(),
                  [](const BuiltTag& a, const BuiltTag& b) { return a.id < b.id; });
        if (auto s = write_file(output, format_camera(*setup)); !s)
            return fail("calibrate", s.error());
        std::fprintf(stderr,
                     "sonocase calibrate: note: the body's frame is that of its tags as built: "
                     "calibrate the way to the %s's %s after this, by a pivot\n",
                     tool.c_str(), tool == "probe" ? "face" : "tip");
    }
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
