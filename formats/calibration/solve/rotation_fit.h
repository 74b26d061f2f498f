// SPDX-License-Identifier: Apache-2.0

// Rotations from vectors. Internal to formats/calibration.
#pragma once

#include <span>

#include "formats/base/geometry.h"

namespace sonocase::calibrate {

// The rotation R that minimises sum |to_i - R from_i|^2, from the quaternion form of [Horn 1987]:
// never a reflection. Both spans have the same length; vectors about their centroids.
Matrix3 horn_rotation(std::span<const Vector3> from, std::span<const Vector3> to);

// The rotation by |v| radians about v; the identity for v = 0.
Matrix3 rotation_from_vector(Vector3 rotation_rad);

}  // namespace sonocase::calibrate
