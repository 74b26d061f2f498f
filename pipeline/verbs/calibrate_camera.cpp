// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate camera: a camera's lens, from a video in which the printed board is turned.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>

#include "formats/files/atomic_file.h"
#include "formats/files/jpeg_video.h"
#include "formats/markers/camera_model.h"
#include "formats/markers/detect/grey_jpeg.h"
#include "formats/markers/detect/tag_detector.h"
#include "pipeline/calibration/camera_fit.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct BoardVideo {
    std::vector<BoardView> views;
    int width_px = 0, height_px = 0, pictures = 0, damaged = 0;
};

// The pictures in which the board is seen, evenly thinned out.
Result<BoardVideo> look_at_board(const std::string& path, const MarkerBody& board, int max_views) {
    SONOCASE_TRY(const JpegVideo video, load_jpeg_video(path));
    SONOCASE_TRY(GreyJpegReader reader, GreyJpegReader::create());
    SONOCASE_TRY(TagDetector detector, TagDetector::create());
    BoardVideo out;
    out.pictures = static_cast<int>(video.pictures.size());
    GreyImage picture;
    // Successive pictures of a video say much the same.
    const std::size_t every = std::max<std::size_t>(1, video.pictures.size() / (4 * max_views));
    std::vector<BoardView> views;
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
        BoardView view;
        view.picture = static_cast<int>(i);
        for (SeenTag& tag : found.tags)
            for (const MarkerTag& drawn : board.tags)
                if (drawn.id == tag.id) view.tags.push_back(tag);
        if (view.tags.size() >= 3) views.push_back(std::move(view));
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
    app.add_option("--video", video, "AVI of JPEG pictures (MJPG), or a folder of .jpg files")
        ->type_name("VIDEO")
        ->required();
    app.add_option("-o,--output", output, "Where to write the camera for the player")
        ->type_name("CAMERA.json");
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
    const auto seen = look_at_board(video, board, max_views);
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
    print_warnings("calibrate", report);
    if (auto s = write_report(common, report); !s) return fail("calibrate", s.error());
    if (!fit.problem.empty()) return fail("calibrate", {fit.problem, video, ""});
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

}  // namespace sonocase::pipeline::inline verbs
