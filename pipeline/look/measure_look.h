// SPDX-License-Identifier: Apache-2.0

// What can be measured of a machine's appearance in its frames, before anything is fitted.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formats/image_scores/realism_scores.h"

namespace sonocase::pipeline::inline look {

// A place of known tissue, in pixels of the picture.
struct LookRectangle {
    int x = 0, y = 0, width = 0, height = 0;
    std::string tissue;  // empty: the parenchyma that texture is measured in
};

// Medians of the even patches of a stretch of depth.
struct LookBand {
    double depth_mm = 0;
    int patches = 0;
    double mean = 0, local_sd = 0;  // grey
    double upper_mean = 0;          // sixth tenth of the means: vessels pull the median down
    double grain_along_mm = 0, grain_across_mm = 0;
};

// Bands as wide as the distance between patches; bands of fewer than three patches are left out.
std::vector<LookBand> look_bands(const std::vector<PatchScores>& patches, const BeamImage& grid);
// At depth, a band of which hardly any part is even says little: it needs an eighth of max_patches,
// the largest number of patches of the bands above.
inline bool counts_at_depth(const LookBand& band, int max_patches) {
    return band.patches * 8 >= max_patches;
}

struct LookMeasures {
    int frames = 0;
    int patches = 0;          // even ones: without vessels, walls or shadows
    double black = 0;         // the machine's own black, grey
    bool black_seen = false;  // false: nothing black was seen, and `black` is the darkest grey
    PatchScores texture;      // medians over the even patches of the middle depths
    double lowest_mm = 0, highest_mm = 0;  // depths that they span
    std::vector<LookBand> bands;           // of these depths, shallow to deep
    std::vector<LookBand> all_bands;       // these and the deeper ones, where other tissue may lie
    double streaks_per_cm2 = 0;
    WallScores wall;           // fans only
    double first_4_mm = 0;     // mean grey
    std::vector<double> near;  // grey per sample from the face: mean over lines, median of frames
    double near_still = 0;     // correlation of the first 5 mm between frames far apart
    bool moves = false;        // frames differ enough for near_still to mean anything
    std::vector<double> by_line;  // grey per line in the middle depths, median of frames
    std::optional<DiaphragmScore> diaphragm;
    std::map<std::string, double> tissue_grey, tissue_depth_mm;  // of named rectangles, mean
    std::vector<std::string> warnings;
};

// Takes frames one by one, in order; memory does not grow with their pixels.
class LookGauge {
  public:
    // `use`: 1 where a sample may be used; # of the grid. `rectangle`: # of the grid, 1 inside the
    // rectangles of parenchyma; empty: even patches are looked for everywhere.
    LookGauge(BeamImage grid,
              std::vector<std::uint8_t> use,
              std::vector<std::uint8_t> parenchyma,
              std::map<std::string, std::vector<std::uint8_t>> tissues);

    // What one frame contributes; frames may be measured at the same time.
    struct Part {
        std::vector<PatchScores> patches, deep;  // of patches that are not black; deep: below them
        std::vector<double> dark, dark_sd;       // means and sd of smooth squares, grey
        double lowest = 255;                     // hundredth of the means of squares
        double darkest = 255;                    // 500th of the grey of samples
        StreakScore streaks;
        WallScores wall;
        double first_4_mm = 0;
        std::vector<float> near, by_line, near_lines;
        std::optional<DiaphragmScore> diaphragm;
        std::map<std::string, double> tissue_sum;
    };
    Part measure(const BeamImage& image) const;
    void add(Part part);

    LookMeasures result() const;

  private:
    double black(bool& seen) const;
    BeamImage grid_;
    bool anywhere_;                               // even patches are looked for everywhere
    std::vector<std::uint8_t> use_, parenchyma_;  // the latter: where they are looked for
    std::map<std::string, std::vector<std::uint8_t>> tissues_;
    std::vector<Part> parts_;
};

// Whether a patch is parenchyma: bright enough over `black`, without shading, walls or vessels.
bool is_even(const PatchScores& patch, double black);

}  // namespace sonocase::pipeline::inline look
