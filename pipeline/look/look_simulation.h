// SPDX-License-Identifier: Apache-2.0

// Stand-ins that are scored as the real frames were: on the same pixels, at the same depths, with
// the same levels by depth. Internal to pipeline/look.
#pragma once

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "pipeline/look/fit_machine.h"

namespace sonocase::pipeline {

// Looks above near_mm, when there are so many below it.
inline int near_looks(int looks) {
    return std::min(16, 2 * looks);
}

// Draws beam-space grey on the picture's pixels and samples it again, as real frames were: what the
// pixels blur is blurred in the stand-in as well. Where each pixel lies is worked out once.
class PixelPassage {
  public:
    // Rows [first, second) of the grid matter; others come out black.
    PixelPassage(const ScanPlace& place,
                 const BeamImage& grid,
                 std::pair<int, int> rows,
                 int width_px,
                 int height_px);
    BeamImage operator()(const BeamImage& image) const;

  private:
    ScanPlace place_;
    int width_px_, height_px_;
    std::vector<std::size_t> pixels_;
    std::vector<BeamPoint> points_;
};

class LookSimulation {
  public:
    // Refers to `measures` and `options`.
    LookSimulation(const LookMeasures& measures,
                   const ScanPlace& place,
                   int width_px,
                   int height_px,
                   const FitOptions& options);
    const LookMeasures& measures() const { return measures_; }
    const BeamImage& grid() const { return grid_; }
    // Bands whose contrast the grey map is fitted to: those of the middle depths; without a black
    // that was seen, the deeper ones as well, because levels that differ tell the floor.
    const std::vector<LookBand>& contrast_bands() const { return bands_; }
    double base_floor() const { return options_.base.grey.floor; }

    // Amplitude of parenchyma at one level, mean 1, # of the grid.
    std::vector<float> amplitude(const Machine& machine, int looks, std::uint64_t draw) const;
    std::vector<std::vector<float>> amplitudes(const Machine& machine,
                                               std::span<const int> looks) const;

    // Patches at the depths of these bands, drawn with a gain by depth that gives each band the
    // real one's mean. `map.level` is that of the even patches of the middle depths.
    std::vector<PatchScores> scores(const std::vector<float>& amplitude,
                                    const MachineGrey& map) const;
    // Medians of those at the depths that LookMeasures::texture is taken from, and of one band.
    PatchScores middle_scores(const std::vector<PatchScores>& patches) const;
    PatchScores scores_at(const std::vector<PatchScores>& patches, const LookBand& band) const;

  private:
    std::vector<double> gain_by_row(const MachineGrey& map) const;
    const LookMeasures& measures_;
    const FitOptions& options_;
    std::vector<LookBand> bands_;
    BeamImage grid_;
    std::pair<int, int> rows_;
    PixelPassage passage_;
};

}  // namespace sonocase::pipeline
