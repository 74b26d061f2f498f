// SPDX-License-Identifier: Apache-2.0

// Parts that the landmark fit and the skin sweep share. Internal to formats/calibrate.
#pragma once

#include <span>

#include "formats/calibration/landmarks.h"
#include "formats/calibration/least_squares.h"

namespace sonocase::calibrate {

// Rotation that carries the vectors `from` on `to` with least squares (Horn 1987): never a mirror.
Matrix3 horn_rotation(std::span<const Vector3> from, std::span<const Vector3> to);
Matrix3 rotation_from_vector(Vector3 rotation_rad);
// Covariance, sigmas and condition from the Jacobian in (rotation * size, translation[, scale *
// size]).
void fill_uncertainty(const LeastSquaresFit& jacobian, double size, double variance, RigidFit& out);

}  // namespace sonocase::calibrate
