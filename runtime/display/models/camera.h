// SPDX-License-Identifier: Apache-2.0

// The cameras of the 3-D view: from outside, over the probe, along the needle. A camera's frame has
// x to the right, y up and z towards the eye.
#pragma once

#include <array>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/bundle/body_axes.h"
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
// body: box around the skin. The patient stands upright and is seen from the side of the probe;
// where the axes are not known, the probe points down and the long axis of the body runs across.
HomeView home_view(const Box3& body, const Exercise& exercise, const BodyAxes& axes = {});

// A face of the orientation cube that is in sight.
struct CubeFace {
    const char* letter;  // R, L, A, P, H or F: the side of the patient that it is on
    std::array<std::array<double, 2>, 4> corners;  // x to the right, y up; the cube is in [-1, 1]
    double towards_eye;                            // (0, 1]
    Vector3 outward;                               // frame `mannequin`
};
// The faces in sight, the farthest first. camera_from_mannequin: its rotation.
std::vector<CubeFace> cube_faces(const Matrix3& camera_from_mannequin, const BodyAxes& axes);
// The orbit from which a direction of the frame `mannequin` points to the eye.
Orbit orbit_towards(const Matrix3& home, Vector3 outward, double distance_mm);

// home: columns right, up and towards the eye, where yaw and pitch are 0.
Rigid mannequin_from_outside_camera(const Matrix3& home, Point3 interest, const Orbit& orbit);
// Stands behind the face and beside it: the picture is seen at an angle, with what it cuts in front
// of it.
Rigid mannequin_from_probe_camera(const Rigid& mannequin_from_probe);
// Just above the shaft, behind the tip, looking in its direction.
Rigid mannequin_from_needle_camera(const Rigid& mannequin_from_needle);

}  // namespace sonocase::runtime::inline display_models
