// SPDX-License-Identifier: Apache-2.0

// The program sonoplay: its command line, and the run that it asks for.

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <unistd.h>
#include <CLI/CLI.hpp>

#include "formats/base/build_facts.h"
#include "formats/text/nearest_name.h"
#include "runtime/imaging/core/control_limits.h"
#include "runtime/player/headless/make_dataset.h"
#include "runtime/player/headless/run_headless.h"
#include "runtime/player/session/arguments.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/ui/run_window.h"
#include "runtime/tracking/devices/make_tracker.h"

namespace sonocase::runtime {

// Parses into `arguments`. Sets `exit_now` if the program has nothing more to do: after --help and
// --version (returns 0) and after a usage error (returns 2), for which the message has been
// printed. Otherwise returns 0.
int parse_arguments(int argc, char** argv, PlayerArguments& arguments, bool& exit_now);

namespace {

std::vector<std::string> split(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream in(list);
    for (std::string name; std::getline(in, name, ',');) {
        if (!name.empty()) names.push_back(name);
    }
    return names;
}

template <class T>
CLI::Range within(Limits<T> limits) {
    return {limits.min, limits.max};
}

// The options of the Doppler modes.
struct DopplerOptions {
    void add(CLI::App& app, PlayerArguments& arguments) {
        DopplerSettings& doppler = arguments.doppler;
        app.add_option("--mode", mode,
                       "What is shown: b, colour, power, pw (spectral) or m (M-mode)")
            ->check(CLI::IsMember({"b", "colour", "power", "pw", "m", "mmode"}))
            ->group("Doppler");
        app.add_option(
               "--box", box,
               "Colour box LEFT,RIGHT,TOP,BOTTOM: parts of the face and depths in mm; default: "
               "round the widest vessel of the first frame")
            ->expected(4)
            ->delimiter(',')
            ->group("Doppler");
        app.add_option(
               "--gate", gate,
               "Spectral gate or M-line LINE,DEPTH,LENGTH: part of the face, mm; default: the "
               "widest vessel of the first frame, with the cursor along it")
            ->expected(3)
            ->delimiter(',')
            ->group("Doppler");
        angle = app.add_option("--angle", doppler.angle_deg,
                               "Angle cursor, degrees; default: along the vessel of the gate")
                    ->check(within(kAngleDegLimits))
                    ->group("Doppler");
        steer = app.add_option("--steer", doppler.steer_deg,
                               "Steering of a linear probe's lines, degrees; default: 20 to the "
                               "side where the vessel's angle is least")
                    ->check(within(kSteerDegLimits))
                    ->group("Doppler");
        app.add_option("--scale", doppler.scale_cm_s, "Nyquist velocity of the colour box, cm/s")
            ->check(within(kScaleCmSLimits))
            ->group("Doppler");
        spectral_scale = app.add_option("--spectral-scale", doppler.spectral_scale_cm_s,
                                        "Nyquist velocity of the spectrum, cm/s; default: by the "
                                        "fastest blood of the vessel aimed at, else 100")
                             ->check(within(kSpectralScaleCmSLimits))
                             ->group("Doppler");
        app.add_option("--baseline", doppler.baseline, "Shift of velocity 0, part of the scale")
            ->check(within(kBaselineLimits))
            ->group("Doppler");
        app.add_option("--wall-filter", doppler.wall_filter, "Cut-off, part of the scale")
            ->check(within(kWallFilterLimits))
            ->group("Doppler");
        app.add_option("--doppler-gain", doppler.gain_db, "dB")
            ->check(within(kDopplerGainDbLimits))
            ->group("Doppler");
        app.add_option("--priority", doppler.priority, "Grey above this part of white stays grey")
            ->check(within(kPriorityLimits))
            ->group("Doppler");
        app.add_option("--ensemble", doppler.ensemble, "Pulses of a colour line")
            ->check(within(kEnsembleLimits))
            ->group("Doppler");
        app.add_option("--diameter", doppler.diameter_mm,
                       "Of the vessel as measured, mm, for volume flow")
            ->check(within(kDiameterMmLimits))
            ->group("Doppler");
        app.add_option("--sound", arguments.sound,
                       "Headless: WAV file for the sound of the spectrum")
            ->group("Doppler");
    }
    void take(PlayerArguments& arguments) const {
        DopplerSettings& doppler = arguments.doppler;
        doppler.mode = mode == "colour"  ? DopplerMode::colour
                       : mode == "power" ? DopplerMode::power
                       : mode == "pw"    ? DopplerMode::spectral
                       : mode == "b"     ? DopplerMode::off
                                         : DopplerMode::m_mode;
        arguments.box_given = box.size() == 4;
        if (arguments.box_given) {
            doppler.box_left = box[0];
            doppler.box_right = box[1];
            doppler.box_top_mm = box[2];
            doppler.box_bottom_mm = box[3];
        }
        arguments.gate_given = gate.size() == 3;
        arguments.angle_given = angle->count() > 0;
        arguments.steer_given = steer->count() > 0;
        arguments.spectral_scale_given = spectral_scale->count() > 0;
        if (arguments.gate_given) {
            doppler.gate_line = gate[0];
            doppler.gate_depth_mm = gate[1];
            doppler.gate_mm = gate[2];
        }
    }

    std::string mode = "b";
    std::vector<double> box, gate;
    CLI::Option *angle = nullptr, *steer = nullptr, *spectral_scale = nullptr;
};

int wrong_usage(const CLI::App& app, const std::string& what, int argc, char** argv) {
    const std::vector<std::string> words(argv + 1, argv + argc);
    std::vector<std::string> known;
    for (const CLI::Option* option : app.get_options())
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    const std::string unknown = unknown_option(words, known);
    std::fprintf(stderr, "sonoplay: %s; %s --help lists the options\n",
                 unknown.empty() ? what.c_str() : unknown.c_str(), app.get_name().c_str());
    return 2;
}

// Whether the recording would replace the file that is replayed, as it would at the first frame.
bool replaces_replayed(const PlayerArguments& arguments) {
    constexpr std::string_view kReplay = "replay:";
    if (!arguments.tracker.starts_with(kReplay)) return false;
    const std::string files = arguments.tracker.substr(kReplay.size());
    std::vector<std::string> read = split(files);
    read.push_back(files);
    return std::any_of(read.begin(), read.end(), [&](const std::string& file) {
        std::error_code none;
        return std::filesystem::equivalent(file, arguments.record, none);
    });
}

// What is wrong with --record and --trainee; empty: nothing.
std::string recording_fault(const PlayerArguments& arguments) {
    if (arguments.record.empty()) {
        return arguments.headless && !arguments.trainee.empty()
                   ? "--trainee keeps the scores of a recording; use it with --record FILE.igs.mha"
                   : "";
    }
    if (!arguments.record.ends_with(".mha"))
        return "--record " + arguments.record + " does not end in .mha; use e.g. attempt.igs.mha";
    if (replaces_replayed(arguments))
        return "--record " + arguments.record +
               " is the file that --tracker replays; record to another";
    return "";
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
    app.add_option("--exercise", arguments.exercise,
                   "Exercise of the bundle, or a TOML file; default: its first");
    app.add_option("--attempt-seed", arguments.attempt_seed,
                   "Where the attempt's targets lie; 0: as written. Default: new for each attempt "
                   "in a window, a recording's own where it is replayed, else 0")
        ->check(CLI::Range(0.0, 9e18));  // as a double: 64 bits would wrap before the check
    app.add_option("--tracker", arguments.tracker, tracker_help());
    app.add_option("--calibration", arguments.calibrations,
                   "File of a calibration or a lag; may be repeated")
        ->allow_extra_args(false);
    app.add_option("--tool", arguments.tools,
                   "Which transform of an OpenIGTLink stream or recording is which tool: "
                   "probe|needle|reference=NAME; may be repeated. Default: by the names")
        ->type_name("ROLE=NAME")
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
    app.add_flag("--measure-effects", arguments.measure_effects,
                 "With --stats: measure what each effect costs and changes, by drawing frames of "
                 "the run again with and without it; some seconds")
        ->group("Headless");
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
        ->check(within(kScanlineLimits))
        ->group("Picture");
    app.add_option("--samples", arguments.samples, "Samples along a beam; default: the model's")
        ->check(within(kSampleLimits))
        ->group("Picture");
    app.add_option("--looks", arguments.looks,
                   "Speckle fields that are averaged; default: the machine's")
        ->check(within(kLookLimits))
        ->group("Picture");
    app.add_option("--frame-budget", arguments.frame_budget_ms,
                   "In a window: milliseconds per frame above which accuracy is reduced; "
                   "0: never reduced. Recordings are always at full accuracy")
        ->check(CLI::Range(0.0, 1000.0))
        ->group("Picture");
    app.add_option("--press", arguments.press_mm,
                   "Millimetres by which the probe presses deeper than its pose; default: the "
                   "exercise's")
        ->check(within(kPressMmLimits))
        ->group("Picture");
    DopplerOptions doppler;
    doppler.add(app, arguments);
    app.add_option("--threads", arguments.threads, "Rendering threads")
        ->check(within(kThreadLimits))
        ->group("Picture");
    app.add_option(
        "--serve", arguments.serve,
        "OpenIGTLink server [ADDRESS:]PORT that sends IMAGE and TRANSFORM; loopback unless "
        "an address is given");
    app.add_option("--serve-poses", arguments.serve_poses,
                   "WebSocket server [ADDRESS:]PORT that sends probe and needle to pages; its "
                   "address, with a token, is printed. Loopback unless an address is given");
    app.add_flag("--instructor", arguments.instructor,
                 "A second window for the instructor: target, names, marks and tracker, in exams "
                 "too");
    app.add_option("--ui-scale", arguments.ui_scale, "Size of text and controls; 1 is for 1280x720")
        ->check(CLI::Range(0.75, 4.0));
    app.add_option("--screenshot", arguments.screenshot, "Save the window's last picture as PNG")
        ->group("Testing");
    app.add_option("--course", arguments.course,
                   "A course (course.toml) beside those in the folders of cases")
        ->type_name("FILE")
        ->group("Training");
    app.add_option("--script", arguments.script, "Play input events from a file into the window")
        ->group("Testing");
    exit_now = false;
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        exit_now = true;
        if (e.get_exit_code() == 0) return app.exit(e);
        return wrong_usage(app, e.what(), argc, argv);
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
    if (const std::string fault = recording_fault(arguments); !fault.empty()) {
        std::fprintf(stderr, "sonoplay: %s\n", fault.c_str());
        exit_now = true;
        return 2;
    }
    arguments.effects = split(effects);
    doppler.take(arguments);
    return 0;
}

// sonoplay dataset RECIPE.toml -o DIR --frames N [--seed S] [--shard I/N]

// argv[0]: "sonoplay dataset". Returns the exit status: 0 done, 1 failed with one line, 2 wrong
// usage.
int run_dataset_command(int argc, char** argv);

int run_dataset_command(int argc, char** argv) {
    DatasetArguments arguments;
    std::string shard = "1/1";
    CLI::App app{"Render frames at random poses with their truth, as a recipe says.",
                 "sonoplay dataset"};
    app.add_option("recipe", arguments.recipe, "Recipe (*.toml)")->required();
    app.add_option("-o,--out", arguments.out, "Folder of the data set; goes on where it stopped")
        ->required();
    app.add_option("--frames", arguments.frames, "Frames of the whole data set")
        ->required()
        ->check(CLI::Range(1, 100000000));
    app.add_option("--seed", arguments.seed, "Of all that is drawn, from 0 on; default: 1")
        ->check(CLI::Range(0.0, 9e18));  // as a double: 64 bits would wrap before the check
    app.add_option("--shard", shard, "I/N: the I-th of N parts, I from 1; default: 1/1");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0) return app.exit(e);
        return wrong_usage(app, e.what(), argc, argv);
    }
    char extra = 0;
    if (std::sscanf(shard.c_str(), "%d/%d%c", &arguments.shard, &arguments.shards, &extra) != 2 ||
        arguments.shard < 1 || arguments.shard > arguments.shards) {
        std::fprintf(stderr, "sonoplay: --shard %s is not I/N with I from 1 to N; use e.g. 1/4\n",
                     shard.c_str());
        return 2;
    }
    // Progress on a terminal; quiet in a pipe.
    const bool shows = isatty(2) != 0;
    const Status done = make_dataset(arguments, [&](std::uint64_t chunks, std::uint64_t of) {
        if (shows)
            std::fprintf(stderr, "\r%llu of %llu chunks%s", static_cast<unsigned long long>(chunks),
                         static_cast<unsigned long long>(of), chunks == of ? "\n" : "");
    });
    if (done) return 0;
    std::fprintf(stderr, "%ssonoplay: %s\n", shows ? "\n" : "", done.error().message().c_str());
    return 1;
}

}  // namespace sonocase::runtime

using namespace sonocase;
using namespace sonocase::runtime;

int main(int argc, char** argv) {
    const double start_s = steady_seconds();
    // A file that may not grow further is an error of its write, as a full disk is.
    std::signal(SIGXFSZ, SIG_IGN);
    try {
        if (argc > 1 && std::string_view(argv[1]) == "dataset")
            return run_dataset_command(argc - 1, argv + 1);
        PlayerArguments arguments;
        bool exit_now = false;
        const int status = parse_arguments(argc, argv, arguments, exit_now);
        if (exit_now) return status;
        const Status done =
            arguments.headless ? run_headless(arguments, start_s) : run_window(arguments, start_s);
        if (done) return 0;
        std::fprintf(stderr, "sonoplay: %s\n", done.error().message().c_str());
    } catch (const std::exception& e) {
        // Only memory can run out here; everything else is a Result.
        std::fprintf(stderr, "sonoplay: %s; close other programs and try again\n", e.what());
    }
    return 1;
}
