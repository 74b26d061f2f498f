// SPDX-License-Identifier: Apache-2.0

// Short tones that say what happened without a look at the screen.
#pragma once

#include <vector>

namespace sonocase::runtime {

enum class Tone { target, harm };

inline constexpr double kToneHz = 24000;  // samples per second

// Pairs of samples in [-0.3, 0.3], which begin and end with 0. target: two notes upwards, 0.22 s;
// harm: one low note, 0.3 s.
std::vector<float> tone(Tone what);

}  // namespace sonocase::runtime
