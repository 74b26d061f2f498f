// SPDX-License-Identifier: Apache-2.0

// Shape, presence and size of an attempt's lesions. Internal to attempts.
#pragma once

#include "formats/attempt/draws.h"
#include "formats/exercise/exercise.h"

namespace sonocase {

// Axes of a lesion of a kind: turned at random; each 1/elongation to elongation of the ball's
// radius, by the kind's own elongation, the first longer by its aspect. Balls for other targets.
LesionAxes draw_axes(const Target& lesion, Draws& draws);

// Draws shapes of all targets and findings; which findings there are, and how large. Those that an
// attempt lacks are removed. Findings stay where they are written.
void draw_shapes(Exercise& exercise, Draws& draws);

}  // namespace sonocase
