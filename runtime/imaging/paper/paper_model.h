// SPDX-License-Identifier: Apache-2.0

// Constants of the 2007 image model that the paper leaves open or prints, shared by both renderers.
#pragma once

#include <array>

namespace sonocase::runtime::paper {

inline constexpr double kNoiseSigma = 15;  // grey; printed
// Length of bone or gas that dims to 1/e; the paper only says "the more, the darker".
inline constexpr double kShadowLengthMm = 4;
// Depth that dims to 1/e; the paper only says "a decreasing function".
inline constexpr double kAttenuationLengthMm = 250;

// Radial blur: copies turned by j * kBlurStepRad about the fan's centre, j = -4..4, blended with
// these weights (sum 1). A linear probe's copies are shifted by j * kBlurStepMm.
inline constexpr int kBlurReach = 4;
inline constexpr double kBlurStepRad = 0.0035;
inline constexpr double kBlurStepMm = 0.15;
inline constexpr std::array<double, 2 * kBlurReach + 1> kBlurWeights{0.04, 0.08, 0.12, 0.16, 0.20,
                                                                     0.16, 0.12, 0.08, 0.04};

}  // namespace sonocase::runtime::paper
