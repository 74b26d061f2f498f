// SPDX-License-Identifier: Apache-2.0

// Effect deformation: a surface of pressed tissue, from the plane that is stored of it at rest.
//
// The distance s(x) from the plane at rest is a function of the pressed place p through x(p), so
// that its gradient there is J^T n:
//
//     along the beam    rise (n . beam)
//     beside it         (n . beside) + tilt (n . beam)
//     across the plane  as at rest
//
// rise and tilt: of the rest depth along the beam and beside it; the sideways shift's own gradient,
// below 0.3, is left out. The pressed normal is the gradient's direction, and the distance is s
// over its length: walls of a closed vein come together.
#pragma once

#include <algorithm>
#include <cmath>

#include "formats/base/geometry.h"

namespace sonocase::runtime::physical {

inline constexpr double kLeastSlope = 0.2, kMostSlope = 50;  // of the gradient's length

// normal: unit, changed, as is the distance. beam, beside: unit, at a right angle.
inline void press_surface(
    Vector3 beam, Vector3 beside, double rise, double tilt, Vector3& normal, double& distance_mm) {
    const double along = dot(normal, beam);
    const Vector3 g = normal + ((rise - 1) * along) * beam + (tilt * along) * beside;
    const double length = std::clamp(norm(g), kLeastSlope, kMostSlope);
    normal = (1 / std::max(norm(g), 1e-9)) * g;
    distance_mm /= length;
}

}  // namespace sonocase::runtime::physical
