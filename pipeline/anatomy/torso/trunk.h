// SPDX-License-Identifier: Apache-2.0

// The trunk of the analytic torso and the layers below its surface, in closed form. `ct` frame, mm.
//
// Cross-section at height z: |x / a|^2.3 + |(y - c) / b|^p = 1 with p = 2 in front and 2.8 behind,
// which makes the back flatter than the belly. At a depth below the surface, a and b are smaller by
// that depth.
#pragma once

#include "formats/base/geometry.h"

namespace sonocase::pipeline {

// Depths below the surface at which the layers end, mm.
inline constexpr double kSkinDepth_mm = 2, kFatDepth_mm = 13, kWallDepth_mm = 25;

inline constexpr double kTorsoHalfHeight_mm = 155;  // of the patient's grid

// Negative for points deeper than `depth_mm`, positive for others; smooth, not a distance.
// belly_mm: AnalyticBody::belly_mm.
double trunk(Point3 p, double depth_mm, double belly_mm);

// Point at `depth_mm` in direction theta (0 right, pi/2 front) at height z, to 1e-12 mm.
Point3 trunk_point(double theta, double z, double depth_mm, double belly_mm);

}  // namespace sonocase::pipeline
