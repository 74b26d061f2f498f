// SPDX-License-Identifier: Apache-2.0

// The part of the fit that needs stand-ins: point spread, looks and grey map.
#pragma once

#include "pipeline/look/fit_machine.h"

namespace sonocase::pipeline {

// Sets beam widths, looks and grey map of `fit.machine`, whose grey floor is already known.
void fit_texture(const LookMeasures& measures,
                 const ScanPlace& place,
                 int width_px,
                 int height_px,
                 const FitOptions& options,
                 FittedMachine& fit);

}  // namespace sonocase::pipeline
