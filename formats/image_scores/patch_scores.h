// SPDX-License-Identifier: Apache-2.0

// Scores of the texture of parenchyma: squares of 48 x 48 samples in beam space.
//
// "Local" scores are of the detail: the patch less its own Gaussian trend of sd 12 samples.
#pragma once

#include <span>
#include <vector>

#include "formats/image_scores/beam_image.h"

namespace sonocase {

inline constexpr int kPatch = 48;            // samples and lines
inline constexpr double kTrendSamples = 12;  // sd of the Gaussian trend

struct PatchPlace {
    int sample = 0, line = 0;  // of the corner nearest to the face and to line 0
};

struct PatchScores {
    double depth_mm = 0;  // of the middle
    double mean = 0;      // grey
    double sd = 0;        // grey, of the patch as it is
    double local_sd = 0;  // grey, of the detail, as the next two
    double local_skew = 0;
    double local_kurtosis = 0;     // excess
    double gradient_kurtosis = 0;  // of differences between neighbours along the beam
    double gradient_kurtosis_across = 0;
    double grain_along_mm = 0;  // full width at half height of the detail's autocorrelation
    double grain_across_mm = 0;
};

// A patch of one grey: sd, skew, kurtosis and grain are 0. Cost: 0.3 ms.
PatchScores score_patch(const BeamImage& image, PatchPlace place);

// Places on a grid of `stride` within samples [first, end) and lines [first, end) where `use`
// (empty: everywhere) is set at each sample of the patch.
std::vector<PatchPlace> patch_places(const BeamImage& image,
                                     int first_sample,
                                     int end_sample,
                                     int first_line,
                                     int end_line,
                                     int stride,
                                     std::span<const std::uint8_t> use = {});

// Median of each score over patches; NaN without any.
PatchScores median_scores(std::span<const PatchScores> patches);

// Full width at half height of the autocorrelation of `detail` (rows x columns) along one axis, in
// samples. Each lag's sum is divided by the number of all samples, as a Fourier transform would.
// 0 where the detail is flat, twice the longest lag (half the patch) where it never falls
// to half.
double grain_samples(std::span<const float> detail, int rows, int columns, bool along_rows);

}  // namespace sonocase
