// SPDX-License-Identifier: Apache-2.0

// sonocase markers: sheets to print, with which one camera follows a probe and a needle.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <string>

#include "formats/calibration/calibration.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "pipeline/markers/marker_sheets.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

// What the player takes for the way from a body to its tool, as it is drawn on the sheet.
Calibration as_drawn(const MarkerBody& body, const std::string& date) {
    Calibration c;
    c.kind = body.name;
    c.sensor = "marker " + body.name;
    c.sensor_from_tool = body.body_from_tool;
    c.date = date;
    c.warnings = {
        "As drawn, not measured: check it by touching a point, or calibrate it by a pivot."};
    return c;
}

}  // namespace

int verb_markers(int argc, char** argv) {
    CLI::App app(
        "Print sheets with which one camera follows a probe and a needle: two bodies to fold and a "
        "board for the table or the mannequin");
    MarkerSizes sizes;
    std::string out, stl, calibrations, paper_name = "a4";
    CommonOptions common;
    app.add_option("-o,--output", out, "Sheets to print")->type_name("SHEET.pdf");
    app.add_option("--paper", paper_name, "Paper")
        ->check(CLI::IsMember({"a4", "letter"}))
        ->capture_default_str();
    app.add_option("--body", sizes.body_mm,
                   "Size of the bodies, mm: edge of the cube round which they just fit")
        ->capture_default_str();
    app.add_option("--probe-reach", sizes.probe_reach_mm,
                   "From the middle of the body to the probe's face, mm")
        ->capture_default_str();
    app.add_option("--needle-reach", sizes.needle_reach_mm,
                   "From the middle of the body to the needle's tip, mm")
        ->capture_default_str();
    app.add_option("--board-tag", sizes.board_tag_mm, "Edge of a tag of the board, mm")
        ->capture_default_str();
    app.add_option("--stl", stl, "Folder for both bodies as solids for a 3-D printer")
        ->type_name("DIR");
    app.add_option("--calibrations", calibrations,
                   "Folder for the way from each body to its tool as drawn, for the player")
        ->type_name("DIR");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (out.empty() && stl.empty() && calibrations.empty())
        return wrong_usage("markers", "nothing to write: use -o, --stl or --calibrations");
    const Stopwatch watch;
    if (auto s = check_marker_sizes(sizes); !s) return fail("markers", s.error());
    const std::vector<MarkerBody> bodies = marker_bodies(sizes);
    if (!out.empty()) {
        const Paper& paper = kPapers[paper_name == "letter" ? 1 : 0];
        const auto sheets = marker_sheets(sizes, paper);
        if (!sheets) return fail("markers", sheets.error());
        if (auto s = write_file(out, pdf_of(*sheets)); !s) return fail("markers", s.error());
    }
    for (const MarkerBody& body : bodies) {
        if (body.role == MarkerRole::board) continue;
        if (!stl.empty()) {
            if (auto s = write_file(stl + "/" + body.name + ".stl", stl_of(body)); !s)
                return fail("markers", s.error());
        }
        if (!calibrations.empty()) {
            const std::time_t now = std::time(nullptr);
            std::tm utc{};
            gmtime_r(&now, &utc);
            char date[32];
            std::strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &utc);
            if (auto s = save_calibration(as_drawn(body, date),
                                          calibrations + "/" + body.name + ".json");
                !s)
                return fail("markers", s.error());
        }
    }
    const BodyDrawing drawing = body_drawing(sizes.body_mm);
    StageReport report;
    report.stage = "markers";
    report.measures = {{"body_mm", sizes.body_mm},
                       {"side_tag_mm", drawing.side_tag_mm},
                       {"top_tag_mm", drawing.top_tag_mm},
                       {"board_tag_mm", sizes.board_tag_mm},
                       {"board_pitch_mm", board_pitch_mm(sizes)}};
    report.seconds = watch.seconds();
    if (auto s = write_report(common, report); !s) return fail("markers", s.error());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
