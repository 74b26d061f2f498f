// SPDX-License-Identifier: Apache-2.0

// Level of parenchyma by depth -> far gain. Internal to pipeline/look.
#pragma once

#include "pipeline/look/fit_machine.h"

namespace sonocase::pipeline {

// dB that the far gain takes away at a depth.
double far_fall_db(const MachineGain& gain, double depth_mm);

// Far gain, from the bands' levels through the grey map of `fit.machine`, which is known: flat to
// far_from_mm, then a straight fall to far_limit_db. The level of the grey map, so far that of the
// middle depths, becomes that of the flat part. What the depths seen do not show (a fall, its end)
// stays the base's.
void fit_far_gain(const LookMeasures& measures, const BeamImage& grid, FittedMachine& fit);

}  // namespace sonocase::pipeline
