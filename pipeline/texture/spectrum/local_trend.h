// SPDX-License-Identifier: Apache-2.0

// Removal of the local trend of grey. Correlation widths of real patches are comparable only after
// it: shading across the patch would otherwise count as grain.
#pragma once

#include <span>
#include <vector>

#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

// Standard deviation of the trend, as in the published table of the real patches.
inline constexpr double kGrainTrendPx = 12;

// An image minus its Gaussian mean of standard deviation sigma_px; the overall mean is kept.
ExampleImage without_local_trend(const ExampleImage& image, double sigma_px);

// Likewise for each plane z = const of a cube that wraps; # edge^3, edge even.
std::vector<float> without_local_trend(std::span<const float> cube, int edge, double sigma_px);

// Gain of that removal for each wave of a plane that wraps, in [0, 1]; # edge^2, x fastest.
std::vector<double> local_trend_gain(int edge, double sigma_px);

}  // namespace sonocase::pipeline
