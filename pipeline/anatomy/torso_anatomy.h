// SPDX-License-Identifier: Apache-2.0

// The analytic torso in closed form: its trunk, the layers below its surface, and the solids that
// fill it. `ct` frame, mm.
//
// Cross-section at height z: |x / a|^2.3 + |(y - c) / b|^p = 1 with p = 2 in front and 2.8 behind,
// which makes the back flatter than the belly. At a depth below the surface, a and b are smaller by
// that depth.
#pragma once

#include <variant>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline anatomy {

// Depths below the surface at which the layers end, mm.
inline constexpr double kSkinDepthMm = 2, kFatDepthMm = 13, kWallDepthMm = 25;

inline constexpr double kTorsoHalfHeightMm = 155;  // of the patient's grid

// Negative for points deeper than `depth_mm`, positive for others; smooth, not a distance.
// belly_mm: AnalyticBody::belly_mm.
double trunk(Point3 p, double depth_mm, double belly_mm);

// Point at `depth_mm` in direction theta (0 right, pi/2 front) at height z, to 1e-12 mm.
Point3 trunk_point(double theta, double z, double depth_mm, double belly_mm);

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

// The palette and the solids of the analytic torso.

struct TorsoAnatomy {
    std::vector<Label> labels;  // outside first
    std::vector<Solid> solids;  // where solids overlap, the last one counts
};

// The same object at every call. Thread-safe.
const TorsoAnatomy& torso_anatomy();
const TorsoAnatomy& tube_phantom();

}  // namespace sonocase::pipeline::inline anatomy
