// SPDX-License-Identifier: Apache-2.0

// What the user asked for on the command line of sonoplay.
#pragma once

#include <string>
#include <vector>

namespace sonocase::runtime {

struct PlayerArguments {
    std::string bundle;    // empty: the list of bundles
    std::string exercise;  // empty: the first of the bundle
    std::string tracker;   // empty: mouse in a window, the first sweep when headless
    bool headless = false;
    int frames = 0;                   // 0: all of the sweep or recording
    int width_px = 0, height_px = 0;  // 0: 512 x 512 headless, window default otherwise
    std::string out;                  // folder for frames
    std::string stats;                // JSON file, "-" for standard output
    std::string record;
    std::string trainee;  // a chosen name for the progress book; empty: keep no progress
    std::string model;    // "", "paper", "physical"
    std::vector<std::string> effects;
    std::string renderer = "fast";
    int threads = 1;
    int scanlines = 0, samples = 0;  // 0: the model's own
    double frame_budget_ms = 15;     // window: what a frame may take; 0: full accuracy always
    std::vector<std::string> calibrations;
    std::string serve;       // [ADDRESS:]PORT of the OpenIGTLink server; empty: none
    double ui_scale = 0;     // 0: the settings' or the monitor's
    std::string screenshot;  // window: save the last picture of the window here
    std::string script;      // window: input events to play, for tests
};

// Parses; returns 0 to go on, otherwise the process's exit status with everything already said.
// `exit_now` tells --help (status 0) from going on.
int parse_arguments(int argc, char** argv, PlayerArguments& arguments, bool& exit_now);

}  // namespace sonocase::runtime
