// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/command_line.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <sstream>

#include "formats/base/build_facts.h"
#include "runtime/tracking/factory/make_tracker.h"

namespace sonocase::runtime {
namespace {

std::vector<std::string> split(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream in(list);
    for (std::string name; std::getline(in, name, ',');) {
        if (!name.empty()) names.push_back(name);
    }
    return names;
}

}  // namespace

int parse_arguments(int argc, char** argv, PlayerArguments& arguments, bool& exit_now) {
    CLI::App app{"Scan a case bundle with a tracked probe, the mouse or a script.", "sonoplay"};
    std::string facts = build_facts();
    facts.pop_back();  // the last end of line is printed by the library
    app.footer(
        "sonoplay dataset RECIPE.toml -o DIR --frames N renders whole data sets; see "
        "sonoplay dataset --help.");
    app.set_version_flag("--version", facts);
    std::string size, effects;
    app.add_option("bundle", arguments.bundle,
                   "Case bundle (*.sonocase); without one: choose from a list");
    app.add_option("--exercise", arguments.exercise, "Exercise of the bundle; default: its first");
    app.add_option("--tracker", arguments.tracker, tracker_help());
    app.add_option("--calibration", arguments.calibrations,
                   "File of a calibration or a lag; may be repeated")
        ->allow_extra_args(false);
    app.add_flag("--headless", arguments.headless, "No window: render frames and stop")
        ->group("Headless");
    app.add_option("--frames", arguments.frames,
                   "Frames to render, spread over the sweep or taken from the recording in order")
        ->check(CLI::Range(1, 100000000))
        ->group("Headless");
    app.add_option("--size", size, "Size WxH of the picture or the window")->group("Headless");
    app.add_option("--out", arguments.out, "Folder for PNG frames")->group("Headless");
    app.add_option("--truth", arguments.truth,
                   "Folder for what each frame shows: labels, needle, shadow and depth as PNG, and "
                   "truth.jsonl")
        ->group("Headless");
    app.add_option("--stats", arguments.stats,
                   "Write times and costs as JSON; - for standard output");
    app.add_option("--record", arguments.record, "Record the session to FILE.igs.mha");
    app.add_option("--trainee", arguments.trainee,
                   "With --record: a chosen name, under which the scores are kept on this machine");
    app.add_option("--model", arguments.model, "Image model; default: the exercise's")
        ->check(CLI::IsMember({"physical", "paper"}))
        ->group("Picture");
    app.add_option("--effects", effects, "auto | all | comma-separated names")->group("Picture");
    app.add_option("--machine", arguments.machine,
                   "How the scanner draws, model physical: modern | modern-linear | classic, or a "
                   "TOML file; default: modern, or modern-linear for a linear probe")
        ->group("Picture");
    app.add_option("--renderer", arguments.renderer, "fast | reference")
        ->check(CLI::IsMember({"fast", "reference"}))
        ->group("Picture");
    app.add_option("--scanlines", arguments.scanlines, "Beams; default: the model's")
        ->check(CLI::Range(8, 2048))
        ->group("Picture");
    app.add_option("--samples", arguments.samples, "Samples along a beam; default: the model's")
        ->check(CLI::Range(16, 4096))
        ->group("Picture");
    app.add_option("--looks", arguments.looks,
                   "Speckle fields that are averaged; default: the machine's")
        ->check(CLI::Range(1, 16))
        ->group("Picture");
    app.add_option("--frame-budget", arguments.frame_budget_ms,
                   "In a window: milliseconds per frame above which accuracy is reduced; "
                   "0: never reduced. Recordings are always at full accuracy")
        ->check(CLI::Range(0.0, 1000.0))
        ->group("Picture");
    app.add_option("--press", arguments.press_mm,
                   "Millimetres by which the probe presses deeper than its pose; default: the "
                   "exercise's")
        ->check(CLI::Range(0.0, 40.0))
        ->group("Picture");
    app.add_option("--threads", arguments.threads, "Rendering threads")
        ->check(CLI::Range(1, 256))
        ->group("Picture");
    app.add_option(
        "--serve", arguments.serve,
        "OpenIGTLink server [ADDRESS:]PORT that sends IMAGE and TRANSFORM; loopback unless "
        "an address is given");
    app.add_option("--ui-scale", arguments.ui_scale, "Size of text and controls; 1 is for 1280x720")
        ->check(CLI::Range(0.75, 4.0));
    app.add_option("--screenshot", arguments.screenshot, "Save the window's last picture as PNG")
        ->group("Testing");
    app.add_option("--script", arguments.script, "Play input events from a file into the window")
        ->group("Testing");
    exit_now = false;
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        exit_now = true;
        if (e.get_exit_code() == 0) return app.exit(e);
        std::fprintf(stderr, "sonoplay: %s; sonoplay --help lists the options\n", e.what());
        return 2;
    }
    if (!size.empty()) {
        int w = 0, h = 0;
        char extra = 0;
        if (std::sscanf(size.c_str(), "%dx%d%c", &w, &h, &extra) != 2 || w < 16 || h < 16 ||
            w > 8192 || h > 8192) {
            std::fprintf(stderr,
                         "sonoplay: --size %s is not WxH with sides from 16 to 8192; use e.g. "
                         "512x512\n",
                         size.c_str());
            exit_now = true;
            return 2;
        }
        arguments.width_px = w;
        arguments.height_px = h;
    }
    arguments.effects = split(effects);
    return 0;
}

}  // namespace sonocase::runtime
