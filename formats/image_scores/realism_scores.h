// SPDX-License-Identifier: Apache-2.0

// Scores of the realism of a picture in beam space, and the limits within which living tissue lies
// (docs/realism.md): the texture of parenchyma in patches of 48 x 48 samples; how much speckle two
// frames share; and what stands out of the texture, which is streaks, layers of the body wall, the
// near field, the diaphragm and the black behind it.
//
// The detail of a patch is the patch minus its own Gaussian trend of sd 12 samples; "local" scores
// are those of the detail.
#pragma once

#include <optional>
#include <span>
#include <string_view>
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
    double local_sd = 0;  // grey
    double local_skew = 0;
    double local_kurtosis = 0;     // excess
    double gradient_kurtosis = 0;  // of differences between neighbours along the beam
    double gradient_kurtosis_across = 0;
    double grain_along_mm = 0;  // full width at half height of the detail's autocorrelation
    double grain_across_mm = 0;
};

// A patch of one grey: sd, skew, kurtosis and grain are 0. Cost: 0.3 ms.
PatchScores score_patch(const BeamImage& image, PatchPlace place);

// Places on a grid of `stride` within samples [first, end) and lines [first, end) at which `use` is
// set for each sample of the patch. use: empty for everywhere.
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

struct DetailMatch {
    double correlation = 0;      // best over the shifts, [-1, 1]; 0 where the detail is flat
    int samples = 0, lines = 0;  // shift of `after` against `before` there
};

// Best normalised correlation of the detail of a patch of `before` with that of `after`, shifted in
// the plane by up to `reach` samples and lines. Unrelated speckle gives 0.1 to 0.2, by chance and
// the search. Cost: (2 reach + 1)^2 times 5 microseconds.
DetailMatch match_detail(const BeamImage& before,
                         const BeamImage& after,
                         PatchPlace place,
                         int reach = 4);

// Bright streaks: connected places where the detail, smoothed across the beams with sd 1 mm,
// exceeds kStreakGrey and 2.75 of its own robust sd (1.48 times the median deviation), at least
// kStreakMm long across the beams and on average no thicker than a third of that. Pure speckle
// gives 0.05 per cm2.
inline constexpr double kStreakGrey = 6, kStreakMm = 3;
struct StreakScore {
    int count = 0;
    double area_cm2 = 0;
    double length_mm = 0;    // median; NaN without streaks
    double excess_grey = 0;  // median of the highest detail of each; NaN without streaks
    double per_cm2() const { return area_cm2 > 0 ? count / area_cm2 : 0; }
};
// Scores the rectangle of samples [first, end) and lines [first, end).
StreakScore score_streaks(
    const BeamImage& image, int first_sample, int end_sample, int first_line, int end_line);

// The body wall between two depths, over the middle four fifths of the lines.
struct WallScores {
    double layers = 0;        // bright layers per beam, median
    double thickness_mm = 0;  // full width at half height over the ground, median
    double peak_grey = 0;     // median
    double across[5] = {};    // autocorrelation across the beams at kWallLagsMm
};
inline constexpr double kWallLagsMm[5] = {1.3, 2.7, 5, 10, 16};
WallScores score_wall(const BeamImage& image, double from_mm = 2, double to_mm = 28);

// Mean grey between two depths, over the middle four fifths of the lines.
double mean_grey(const BeamImage& image, double from_mm, double to_mm);

// The brightest long line between two depths with darkness behind it.
struct DiaphragmScore {
    int beams = 0;          // beams that show it
    double peak_grey = 0;   // median over beams
    double width_mm = 0;    // full width at half height, perpendicular to the line, median
    double black_grey = 0;  // mean and sd 15 to 30 mm behind it, darkest quarter of the beams
    double black_sd = 0;
};
// Empty where fewer than 12 neighbouring beams show such a line.
std::optional<DiaphragmScore> score_diaphragm(const BeamImage& image,
                                              double from_mm = 85,
                                              double to_mm = 130);

// The limits within which a score of living tissue lies, fitted to blocks of six frames of a
// tracked sweep of one volunteer's liver (CC BY 4.0, ImFusion GmbH, public-ultrasound-demos) and
// widened by about a tenth for other machines. docs/realism.md says where each comes from.
struct ScoreLimits {
    std::string_view name;   // "liver_mean": also in JSON
    std::string_view title;  // "liver mean grey"
    std::string_view unit;   // "mm"; empty: a ratio
    double low = 0, high = 0;
    bool holds(double value) const { return value >= low && value <= high; }
};

// In the order of docs/realism.md.
std::span<const ScoreLimits> score_limits();
// The limits of that name, which must exist.
const ScoreLimits& limits_of(std::string_view name);

}  // namespace sonocase
