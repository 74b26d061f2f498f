// SPDX-License-Identifier: Apache-2.0

// The cameras of the 3-D view: from outside, over the probe, along the needle. A camera's frame has
// x to the right, y up and z towards the eye.
#pragma once

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"

namespace sonocase::runtime::inline display_models {

// A place on a sphere about the point of interest.
struct Orbit {
    double yaw_rad = 0.6, pitch_rad = 0.62;
    double distance_mm = 620;
};

enum class ViewFrom { outside, probe, needle };

// Where the view from outside stands at first.
struct HomeView {
    Matrix3 home;     // columns: right, up, towards the eye
    Point3 interest;  // the point that it turns about
    Orbit orbit;
};
// body: box around the skin. The probe points down, the long axis of the body runs across.
HomeView home_view(const Box3& body, const Exercise& exercise);

// home: columns right, up and towards the eye, where yaw and pitch are 0.
Rigid mannequin_from_outside_camera(const Matrix3& home, Point3 interest, const Orbit& orbit);
// Stands behind the face and beside it: the picture is seen at an angle, with what it cuts in front
// of it.
Rigid mannequin_from_probe_camera(const Rigid& mannequin_from_probe);
// Just above the shaft, behind the tip, looking in its direction.
Rigid mannequin_from_needle_camera(const Rigid& mannequin_from_needle);

}  // namespace sonocase::runtime::inline display_models
