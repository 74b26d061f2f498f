// SPDX-License-Identifier: Apache-2.0

// Shape, presence and size of an attempt's lesions. Internal to attempts.
#pragma once

#include "formats/base/random.h"
#include "formats/exercise/exercise.h"

namespace sonocase {

// Axes of a lesion of a kind, turned at random: each 1/elongation to elongation times the ball's
// radius, and the first longer by the aspect. Targets without a kind stay balls.
LesionAxes draw_axes(const Target& lesion, RandomStream& draws);

// Draws the shapes of all targets and findings, which findings are present, and their radii.
// Removes the findings that the attempt lacks; the others stay where they are written.
void draw_shapes(Exercise& exercise, RandomStream& draws);

}  // namespace sonocase
