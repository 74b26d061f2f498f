// SPDX-License-Identifier: Apache-2.0

// An attempt at an exercise: where its targets lie this time, and where the probe begins. Both are
// drawn from a seed, so that no two attempts can be passed by the same movements, and the seed in a
// recording brings the same attempt back.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"

namespace sonocase {

struct AttemptDraw {
    Exercise exercise;                  // with targets and start as drawn
    std::vector<std::string> warnings;  // whole sentences: what could not be drawn
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
//   - it overlaps no other target;
//   - the needle reaches it: a straight line of at most the needle's length, less 10 mm, leads from
//     the skin to it through no bone, no gas and no structure to be spared;
//   - it can be imaged meanwhile: another line, no longer than the image is deep, 20 to 80 degrees
//     from the first, leads to it through no bone and no gas.
// A target for which 400 draws find no such place stays at its centre, with a warning.
//
// A target whose look is a kind of formats/pathology gets an ellipsoid's shape. Findings are there
// with their `chance`, with a radius and shape that are drawn, placed likewise in their spread_mm,
// clear of the targets and of each other; they need not be reached. One that finds no place is left
// out, with a warning.
//
// With start_spread_mm > 0 the probe begins on the skin, half to all of that distance from
// start_probe. Of 200 places drawn it is the first where every target lies at least 20 mm beside
// the scan plane that the mouse holds there, else the one where they lie farthest beside it.
//
// The same arguments give the same attempt on every machine: only +, -, *, / and square roots are
// used. Cost: some milliseconds.
AttemptDraw draw_attempt(const Exercise& exercise,
                         const Anatomy& anatomy,
                         const std::vector<Label>& labels,
                         std::uint64_t seed);

}  // namespace sonocase
