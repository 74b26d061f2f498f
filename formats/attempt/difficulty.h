// SPDX-License-Identifier: Apache-2.0

// How hard an attempt is beside the exercise as it is written: a part of the attempt's seed, so
// that whatever keeps the seed (recording, progress book, command line) brings the same attempt
// back, and nothing else has to be kept.
#pragma once

#include <cstdint>

#include "formats/exercise/exercise.h"

namespace sonocase {

// In units of its own: -2 and -1 are easier, 0 is as written, 1 and 2 are harder.
inline constexpr int kEasiest = -2, kHardest = 2;

// Bits 40 to 42 of the seed hold 1 to 4 for -1, -2, 1, 2; seeds below 2^40, and all with higher
// bits, are attempts as written. A number below 2^53 goes through JSON unchanged.
int attempt_difficulty(std::uint64_t seed);
// seed < 2^40; 0 stays 0: nothing is drawn.
std::uint64_t seed_with_difficulty(std::uint64_t seed, int difficulty);

// What a difficulty changes before targets and start are drawn:
//
//   difficulty   where targets may lie   way from the target to the start   radius of a hit
//      -2            0.4                       0.6                              1
//      -1            0.7                       0.8                              1
//       0            1                         1                                1
//       1            1                         1.2                              0.85
//       2            1                         1.4                              0.7
//
// Drawn lesions shrink with the radius of a hit; structures of the anatomy keep their size. Pass
// marks stay as they are written, so that a pass says the same at every difficulty but for where
// the target lay.
void apply_difficulty(int difficulty, Exercise& exercise);

}  // namespace sonocase
