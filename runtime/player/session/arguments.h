// SPDX-License-Identifier: Apache-2.0

// What the user asked for on the command line of sonoplay (runtime/player/main.cpp).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/imaging/core/frame_input.h"

namespace sonocase::runtime::inline player_session {

struct PlayerArguments {
    std::string bundle;    // empty: the list of bundles
    std::string exercise;  // name, or a TOML file; empty: the first of the bundle
    // Seed of the attempt's target positions; 0: as written. Negative: a new one for each attempt
    // in a window, the recording's own where one is replayed, else 0.
    std::int64_t attempt_seed = -1;
    std::string tracker;  // empty: mouse in a window, the first sweep when headless
    bool headless = false;
    int frames = 0;                   // 0: all of the sweep or recording
    int width_px = 0, height_px = 0;  // 0: 512 x 512 when headless, the window's default otherwise
    std::string out;                  // folder for frames; empty: none are written
    std::string truth;                // folder for what the frames show; empty: none
    std::string stats;                // JSON file, "-" for standard output; empty: none
    bool measure_effects = false;     // headless, with stats: what each costs, by leaving it out
    std::string record;               // recording to write; empty: none
    std::string trainee;  // a chosen name for the progress book; empty: no progress is kept
    std::string model;    // "paper", "physical"; empty: the exercise's
    std::vector<std::string> effects;  // empty: the exercise's
    std::string machine;               // name or file; empty: by the probe's shape
    std::string renderer = "fast";     // "fast", "reference"
    DopplerSettings doppler;           // mode and controls that the run begins with
    // False: box and gate go to the widest vessel of the first frame, along its flow.
    bool box_given = false, gate_given = false, angle_given = false, steer_given = false;
    bool spectral_scale_given = false;  // false: from the vessel aimed at
    std::string sound;                  // WAV of the spectral mode; empty: none
    double press_mm = -1;               // that the probe is pressed in; negative: the exercise's
    int threads = 1;
    int scanlines = 0, samples = 0;         // 0: the model's own
    int looks = 0;                          // 0: the machine's
    double frame_budget_ms = 15;            // window: time per frame; 0: full accuracy always
    std::vector<std::string> calibrations;  // files
    std::vector<std::string> tools;         // "needle=StylusTipToTracker": names in a stream
    std::string serve;                      // [ADDRESS:]PORT of the OpenIGTLink server; empty: none
    std::string serve_poses;  // [ADDRESS:]PORT of the pose server for pages; empty: none
    bool instructor = false;  // window: a second one for the instructor
    double ui_scale = 0;      // 0: from the settings, else from the monitor
    std::string screenshot;   // window: file for its last picture; empty: none
    std::string script;       // window: input events to play, for tests
    std::string course;       // window: a course beside those of the folders; empty: none
};

}  // namespace sonocase::runtime::inline player_session
