// SPDX-License-Identifier: Apache-2.0

// Where the 3-D view is looked at from: outside, over the probe, along the needle. The camera's
// frame has x to the right, y up and z towards the eye.
#pragma once

#include "formats/base/geometry.h"

namespace sonocase::runtime {

// Turned about a point of interest; angles in radians, lengths in mm.
struct Orbit {
    double yaw_rad = 0.6, pitch_rad = 0.62;
    double distance_mm = 620;
};

enum class ViewFrom { outside, probe, needle };

// home: columns right, up, towards the eye, seen from where yaw and pitch are 0.
Rigid mannequin_from_outside_camera(const Matrix3& home, Point3 interest, const Orbit& orbit);
// Behind and beside the face, so that the picture is seen at a slant and what it cuts before it.
Rigid mannequin_from_probe_camera(const Rigid& mannequin_from_probe);
// Just above the shaft, behind the tip, looking where it points.
Rigid mannequin_from_needle_camera(const Rigid& mannequin_from_needle);

}  // namespace sonocase::runtime
