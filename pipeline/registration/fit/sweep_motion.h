// SPDX-License-Identifier: Apache-2.0

// Whether the mannequin moved while it was swept, from the readings and their order alone.
//
// If the mannequin moved against the tracker after some reading, the surfaces through the readings
// before and after it differ by a rigid motion, wherever both were read and along the border
// between them. The motion is fitted to the gaps between the two surfaces at each of several places
// in the order. It is real if, fitted in half of the 60 mm cubes of a checkerboard, it closes gaps
// in the other half: where nothing moved, the gaps are noise and no motion closes them.
#pragma once

#include <cstddef>

#include "pipeline/registration/fit/target_surface.h"

namespace sonocase::pipeline::inline registration_fit {

struct SweepMotion {
    bool found = false;
    std::size_t first_after = 0;  // index of the target's first point after the motion
    double shift_mm = 0;          // of the middle of the points after it
    double turn_deg = 0;
    double gap_mm = 0;         // between both surfaces, root of the mean robust square
    double closed_gap_mm = 0;  // the same, the motion undone as the other half of the cubes has it
    double evidence = 0;  // # pairs of readings of either part, times the logarithm of the gain
    double overlap = 0;   // share of the smaller part that has a counterpart in the other one
};

// Motions of less than 2 mm are within what readings of a soft skin differ by, and not looked for.
// What both parts do not show is not found: a motion along the skin, or of parts that have no
// border.
//
// target  a cloud in the order of its readings; of a mesh none is found
//
// Same answer for any number of threads. Cost: 60 ms of one core for 2,000 points, and no more for
// larger clouds, of which every n-th point is taken.
SweepMotion find_sweep_motion(const TargetSurface& target);

}  // namespace sonocase::pipeline::inline registration_fit
