// SPDX-License-Identifier: Apache-2.0

// Scores of what stands out of the texture: streaks in parenchyma, layers of the body wall, the
// near field, the diaphragm and the black behind it.
#pragma once

#include <optional>
#include <span>

#include "formats/image_scores/patch_scores.h"

namespace sonocase {

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
// In the rectangle of samples [first, end) and lines [first, end).
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
    int beams = 0;          // that show it
    double peak_grey = 0;   // median over beams
    double width_mm = 0;    // full width at half height, perpendicular to the line, median
    double black_grey = 0;  // mean and sd 15 to 30 mm behind it, darkest quarter of the beams
    double black_sd = 0;
};
// Empty where fewer than 12 neighbouring beams show such a line.
std::optional<DiaphragmScore> score_diaphragm(const BeamImage& image,
                                              double from_mm = 85,
                                              double to_mm = 130);

}  // namespace sonocase
