// SPDX-License-Identifier: Apache-2.0

// What the player remembers from one run to the next, and the user's XDG folders for it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime::inline player_app {

// $XDG_CONFIG_HOME/sonocase, else ~/.config/sonocase; empty without a home folder.
std::string config_folder();
// $XDG_DATA_HOME/sonocase, else ~/.local/share/sonocase: cases/, calibrations/, sessions/; empty
// without a home folder.
std::string data_folder();

// "~" or "~/x" with the user's home folder in place of "~", as a shell does it; anything else
// unchanged.
std::string expand_home(const std::string& path);

struct Settings {
    int window_width_px = 1280, window_height_px = 720;
    double ui_scale = 0;  // 0: from the monitor
    std::string tracker = "mouse";
    double dynamic_range_db = 60;
    bool show_3d = true, show_exercise = true;
    bool sound = true;                 // tones, and the flow in the spectral mode
    std::string trainee;               // signed in last; empty: none
    std::string language;              // empty: of the locale
    std::vector<std::string> experts;  // names whose attempts set a pass mark
    std::map<std::string, std::vector<std::string>> exam_sets;  // case -> exercises
    std::vector<std::string> recent;                            // bundles, newest first; at most 12
    std::vector<std::string> calibrations;                      // files in use
    // Of a device whose sensors have numbers: from 0; -1: none.
    int probe_sensor = 0, needle_sensor = 1, reference_sensor = -1;
    std::vector<std::string> tools;  // "needle=StylusTipToTracker": of one whose sensors have names
};

// A missing file gives the defaults; so does a damaged one, with the reason in `warning`, a whole
// sentence. Values out of range are brought into it.
Settings load_settings(const std::string& path, std::string& warning);
Status save_settings(const Settings& settings, const std::string& path);

}  // namespace sonocase::runtime::inline player_app
