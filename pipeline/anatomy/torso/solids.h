// SPDX-License-Identifier: Apache-2.0

// The solids of the analytic torso. `ct` frame, mm.
#pragma once

#include <variant>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline {

struct Ellipsoid {
    Point3 centre;
    Vector3 axes;           // half-lengths
    Matrix3 local_from_ct;  // rotation
};

struct Tube {  // a chain of capsules
    std::vector<Point3> path;
    double radius;
};

struct Layer {
    double depth;  // everything deeper than this below the skin, mm
};

struct Solid {
    int label;  // palette index
    std::variant<Ellipsoid, Tube, Layer> shape;
    double within_depth;  // only the part deeper than this below the skin, mm; < 0: all of it
    Box3 box;             // contains the solid
};

// belly_mm: AnalyticBody::belly_mm, of a body that is not scaled.
bool inside(const Solid& solid, Point3 p, double belly_mm);

// Signed distance to the surface of a solid, negative inside. Beyond reach_mm a bound of the same
// sign, of at least reach_mm, is returned instead.
double solid_distance(const Solid& solid, Point3 p, double belly_mm, double reach_mm);

}  // namespace sonocase::pipeline
