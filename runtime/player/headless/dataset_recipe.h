// SPDX-License-Identifier: Apache-2.0

// What a data set is made of: a TOML file. docs/python.md has an example with every key.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime::inline player_headless {

struct Range {
    double low = 0, high = 0;
};

struct DatasetCase {
    std::string bundle;                  // path, as the recipe gives it
    std::string split = "train";         // train | validate | test
    std::vector<std::string> exercises;  // empty: all of the bundle
};

struct DatasetRecipe {
    std::string name = "dataset";
    int width_px = 256, height_px = 256;
    std::string format = "png";  // png | npy
    int chunk = 25;              // frames that share case, exercise, machine, depth and needle
    std::vector<DatasetCase> cases;

    // Where the probe stands: along the exercise's sweeps, or anywhere on the skin.
    std::string region = "sweeps";  // sweeps | skin
    double slide_mm = 15;           // along the skin, each way
    double tilt_deg = 15, rock_deg = 10, rotate_deg = 20;
    Range pressed_mm{0, 4};
    Range time_s{0, 8};

    std::string model = "physical";
    std::vector<std::string> machines;  // empty: the default by the probe's shape
    std::vector<double> depths_mm;      // empty: the exercise's
    Range gain_db{0, 0};

    double needle_share = 0;  // of the frames
    std::vector<double> gauges{18};
    Range tip_depth_mm{20, 80};      // below the probe's face
    Range needle_angle_deg{25, 65};  // between shaft and beam
    double off_plane_mm = 2;         // of the tip, each way
};

// where: names the file in errors, which say line, key and what is expected.
Result<DatasetRecipe> parse_dataset_recipe(std::string_view toml, const std::string& where);

}  // namespace sonocase::runtime::inline player_headless
