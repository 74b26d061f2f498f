// SPDX-License-Identifier: Apache-2.0

// An attempt at an exercise: where its targets lie this time, how hard it is, and where the probe
// begins. All are drawn from a seed, so that no two attempts can be passed by the same movements.
// The difficulty is part of the seed: whatever keeps the seed (recording, progress book, command
// line) gives the same attempt again, and nothing else has to be kept.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/message.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"

namespace sonocase {

// Difficulty: -2 and -1 are easier, 0 is as written, 1 and 2 are harder.
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
// At -2 a needle of the default make becomes a notched one, which is bright at every angle.
// Drawn lesions shrink with the radius of a hit; structures of the anatomy keep their size. Pass
// marks stay as they are written, so that a pass means the same at every difficulty, apart from
// where the target lay.
void apply_difficulty(int difficulty, Exercise& exercise);

struct AttemptDraw {
    Exercise exercise;              // with targets and start as drawn
    std::vector<Message> warnings;  // whole sentences: what could not be drawn
};

// Draws an attempt.
//
// exercise   as written
// anatomy    of the case, at rest
// labels     palette of the anatomy
// seed       0: the exercise as written; any other: a draw, as hard as its attempt_difficulty()
//
// Each target with spread_mm > 0 is placed uniformly in the ball of that radius about its centre,
// where
//   - every point within clearance_mm lies in `inside` (or, without that, in the target's label);
//   - it does not overlap another target;
//   - the needle reaches it: a straight line from the skin, at least 10 mm shorter than the needle,
//     leads to it and meets no bone, no gas and no structure that must be spared;
//   - it can be imaged at the same time: another line, no longer than the image is deep and 20 to
//     80 degrees from the first, leads to it and meets neither bone nor gas.
// A target for which 400 draws find no such place stays at its centre, with a warning.
//
// A target that shows as a kind of formats/pathology gets the shape of an ellipsoid. A finding is
// present with its `chance`, gets a drawn radius and shape, and is placed within its spread_mm,
// clear of the targets and of other findings; the needle need not reach it. A finding without a
// place is left out, with a warning.
//
// With start_spread_mm > 0 the probe begins on the skin, half to all of that distance from
// start_probe. Of 200 places drawn it is the first where sound gets 40 mm deep along most of the
// face and every target lies at least 20 mm from the scan plane that the mouse holds there; or else
// the one where they lie farthest from it, among those that bone and gas leave open if there are
// any.
//
// The same arguments give the same attempt on every machine: only +, -, *, / and square roots are
// used. Cost: some milliseconds.
AttemptDraw draw_attempt(const Exercise& exercise,
                         const Anatomy& anatomy,
                         const std::vector<Label>& labels,
                         std::uint64_t seed);

}  // namespace sonocase
