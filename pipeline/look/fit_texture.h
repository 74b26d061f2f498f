// SPDX-License-Identifier: Apache-2.0

// Stand-ins that are scored as the real frames were: on the same pixels, at the same depths, with
// the same levels by depth. Internal to pipeline/look.
#pragma once

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "pipeline/look/fit_machine.h"

namespace sonocase::pipeline::inline look {

// The number of looks above near_mm for a number of looks below it.
inline int near_looks(int looks) {
    return std::min(16, 2 * looks);
}

// Draws beam-space grey on the pixels of a picture and samples it again, as real frames were, so
// that the pixels blur the stand-in as they blur the frames. The place of each pixel is computed
// once.
class PixelResampling {
  public:
    // Rows [first, second) of the grid are drawn; others stay black.
    PixelResampling(const ScanPlace& place,
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
    // Bands whose contrast the grey map is fitted to: those of the middle depths, and the deeper
    // ones too if no black was seen, because the floor is then found from bands of different
    // levels.
    const std::vector<LookBand>& contrast_bands() const { return bands_; }
    double base_floor() const { return options_.base.grey.floor; }

    // Amplitude of parenchyma at one level, mean 1, # of the grid.
    std::vector<float> amplitude(const Machine& machine, int looks, std::uint64_t draw) const;
    std::vector<std::vector<float>> amplitudes(const Machine& machine,
                                               std::span<const int> looks) const;

    // Patches at the depths of these bands, drawn with a gain by depth that gives each band the
    // mean of the real one. `map.level` holds for the even patches of the middle depths.
    std::vector<PatchScores> scores(const std::vector<float>& amplitude,
                                    const MachineGrey& map) const;
    // Medians over the patches at the depths of LookMeasures::texture, and over those of one band.
    PatchScores middle_scores(const std::vector<PatchScores>& patches) const;
    PatchScores scores_at(const std::vector<PatchScores>& patches, const LookBand& band) const;

  private:
    std::vector<double> gain_by_row(const MachineGrey& map) const;
    const LookMeasures& measures_;
    const FitOptions& options_;
    std::vector<LookBand> bands_;
    BeamImage grid_;
    std::pair<int, int> rows_;
    PixelResampling resampling_;
};

// The part of the fit that needs stand-ins: sets beam widths, looks and grey map of `fit.machine`,
// whose grey floor is already known.
void fit_texture(const LookMeasures& measures,
                 const ScanPlace& place,
                 int width_px,
                 int height_px,
                 const FitOptions& options,
                 FittedMachine& fit);

}  // namespace sonocase::pipeline::inline look
