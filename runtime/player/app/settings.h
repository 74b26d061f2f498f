// SPDX-License-Identifier: Apache-2.0

// What the player remembers from one run to the next.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

struct Settings {
    int window_width_px = 1280, window_height_px = 720;
    double ui_scale = 0;  // 0: from the monitor
    std::string tracker = "mouse";
    double gain_db = 0;
    double dynamic_range_db = 60;
    std::vector<double> tgc_db = std::vector<double>(8, 0.0);
    bool show_3d = true, show_exercise = true, show_tracker = true, show_effects = true;
    std::vector<std::string> recent;          // bundles, newest first; at most 12
    std::vector<std::string> calibrations;    // files in use
    int probe_sensor = 0, needle_sensor = 1;  // from 0; -1: none
};

// A missing file gives the defaults; so does a damaged one, with the reason in `warning`, a whole
// sentence. Values out of range are brought into it.
Settings load_settings(const std::string& path, std::string& warning);
Status save_settings(const Settings& settings, const std::string& path);

}  // namespace sonocase::runtime
