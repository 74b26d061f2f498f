// SPDX-License-Identifier: Apache-2.0

// Numbers that more than one room needs, each once.
#pragma once

#include <numbers>

namespace sonocase {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kRadPerDeg = kPi / 180;
inline constexpr double kDegPerRad = 180 / kPi;

// Speed of sound in soft tissue, as scanners assume it.
inline constexpr double kSpeedOfSoundMPerS = 1540;
inline constexpr double kSpeedOfSoundMmPerS = 1.54e6;

// Full width at half maximum of a Gaussian of unit standard deviation: 2 sqrt(2 ln 2).
inline constexpr double kFullWidthPerSigma = 2.3548200450309493;

}  // namespace sonocase
