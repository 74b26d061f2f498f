// SPDX-License-Identifier: Apache-2.0

// What the player remembers between runs, in the user's XDG folders.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

struct Settings {
    int window_width_px = 1280, window_height_px = 720;
    double ui_scale = 0;  // 0: the monitor's
    std::string tracker = "mouse";
    double gain_db = 0;
    double dynamic_range_db = 60;
    std::vector<double> tgc_db = std::vector<double>(8, 0.0);
    bool show_3d = true, show_exercise = true, show_tracker = true, show_effects = true;
    std::vector<std::string> recent;        // bundles, newest first
    std::vector<std::string> calibrations;  // files in use
    int probe_sensor = 0, needle_sensor = 1;
};

// $XDG_CONFIG_HOME/sonocase, else ~/.config/sonocase; "" when there is no home.
std::string config_folder();
// $XDG_DATA_HOME/sonocase, else ~/.local/share/sonocase: cases/, calibrations/, sessions/.
std::string data_folder();

// A missing file gives the defaults; a damaged one too, with the reason in `warning`.
Settings load_settings(const std::string& path, std::string& warning);
Status save_settings(const Settings& settings, const std::string& path);

struct BundleEntry {
    std::string path;
    std::string name;  // file name without its ending
    std::string folder;
    double megabytes = 0;
    bool recent = false;
};
// Bundles that the start page offers: recent ones, then those in the data folders, beside the
// program and in the current folder.
std::vector<BundleEntry> find_bundles(const Settings& settings);

}  // namespace sonocase::runtime
