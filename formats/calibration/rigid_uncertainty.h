// SPDX-License-Identifier: Apache-2.0

// What the landmark fit and the skin sweep share. Internal to formats/calibration.
#pragma once

#include "formats/calibration/landmarks.h"
#include "formats/calibration/solve/least_squares.h"

namespace sonocase::calibrate {

// Fills covariance, sigmas and condition of `out` from the Jacobian in the unknowns
// (rotation * size, translation[, scale * size]); variance: of one residual, mm^2.
void fill_uncertainty(const LeastSquaresFit& jacobian, double size, double variance, RigidFit& out);

}  // namespace sonocase::calibrate
