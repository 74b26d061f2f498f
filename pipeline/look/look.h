// SPDX-License-Identifier: Apache-2.0

// `sonocase look`: from frames of a real machine to a machine that draws like it.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/image_scores/realism_scores.h"
#include "pipeline/base/progress.h"
#include "pipeline/look/fit_machine.h"

namespace sonocase::pipeline::inline look {

inline constexpr int kLookVersion = 2;  // raised when the same frames give another machine

struct LookInput {
    std::vector<std::string> frames;  // files and folders
    std::string geometry_path;        // JSON (find_scan.h); empty: found in the pixels
    std::vector<LookRectangle> rectangles;
};

struct LookOptions {
    std::string name = "look";  // of the machine
    std::string title;          // empty: made from the name
    std::string base;           // built-in machine; empty: modern, or modern-linear
    double depth_mm = 0;        // of the picture's last row, from the face; 0: from the geometry
    int frames = 120;           // how many are measured at most, evenly spread
    std::uint64_t seed = 1;     // of the stand-ins
};

struct LookScore {
    ScoreLimits limits;
    bool limited = true;  // false: the limits are a liver's, and this scan is not one
    double real = 0;      // NaN: not measured
    double stand_in = 0;  // likewise
};

struct LookPicture {
    std::string caption;
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> grey;
};

struct LookResult {
    FittedMachine fit;
    ScanPlace place;
    bool place_found = false;  // in the pixels
    std::size_t frames_given = 0;
    LookMeasures real, stand_in;
    std::vector<LookScore> scores;
    LookPicture frame, drawn;  // a real frame, and the stand-in on the same pixels
    StageReport report;
};

// Reads the frames that are measured twice: for what stands still, then for the scores. Memory:
// some pictures, whatever the number of frames. Errors: no frames, a file that is not a picture,
// frames of different sizes, black pictures, no scan found, or no scale. Cost: 0.1 s per frame and
// 6 s.
Result<LookResult> measure_look_of(const LookInput& input,
                                   const LookOptions& options,
                                   const Progress& progress = {});

}  // namespace sonocase::pipeline::inline look
