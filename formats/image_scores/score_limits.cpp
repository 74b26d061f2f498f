// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/score_limits.h"

#include <algorithm>
#include <array>
#include <cassert>

namespace sonocase {
namespace {

constexpr std::array<ScoreLimits, 19> kLimits{{
    {"liver_mean", "parenchyma mean grey", "grey", 25, 80},
    {"local_sd", "local standard deviation", "grey", 5, 12},
    {"local_sd_over_mean", "local sd / (mean - black)", "", 0.18, 0.45},
    {"local_skew", "local skew", "", 0.3, 2},
    {"local_kurtosis", "local kurtosis", "", 0.8, 7},
    {"gradient_kurtosis", "kurtosis of the gradient along", "", 0.5, 4},
    {"grain_along_mm", "grain along the beam", "mm", 0.9, 1.3},
    {"grain_across_mm", "grain across the beam", "mm", 1.9, 3.2},
    {"grain_ratio", "grain across / along", "", 1.8, 2.6},
    {"streaks_per_cm2", "bright streaks", "per cm2", 0.2, 0.8},
    {"elevation_correlation", "correlation 0.3 mm across the slice", "", 0.7, 1},
    {"elevation_half_mm", "half of it at", "mm", 0.8, 2.2},
    {"lateral_correlation", "correlation half a beam along the face", "", 0.8, 1},
    {"wall_layers", "bright layers in 2 to 28 mm", "", 4, 8},
    {"wall_across", "autocorrelation across at 2.7 mm, wall", "", 0.65, 1},
    {"near_grey", "mean grey of the first 4 mm", "grey", 40, 110},
    {"diaphragm_peak", "diaphragm, peak", "grey", 90, 180},
    {"diaphragm_width_mm", "diaphragm, width across it", "mm", 2.5, 4.5},
    {"black_grey", "black behind the diaphragm", "grey", 0, 14},
}};

}  // namespace

std::span<const ScoreLimits> score_limits() {
    return kLimits;
}

const ScoreLimits& limits_of(std::string_view name) {
    const auto found = std::find_if(kLimits.begin(), kLimits.end(),
                                    [&](const ScoreLimits& l) { return l.name == name; });
    assert(found != kLimits.end());
    return *found;
}

}  // namespace sonocase
