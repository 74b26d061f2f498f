// SPDX-License-Identifier: Apache-2.0

// The mannequin's surface made ready: a mesh, or a cloud of readings with planes fitted through
// neighbours. Coordinates are those of the file less `origin`, so that far frames lose no digits.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"
#include "pipeline/registration/matching/point_index.h"

namespace sonocase::pipeline {

struct TargetOptions {
    int neighbours = 12;     // of the plane through a reading, >= 6
    double lift_off_mm = 8;  // off the plane of its neighbours by more: the sensor was in the air
};

struct TargetSurface {
    Point3 origin;                     // mannequin frame
    std::vector<Point3> points;        // mannequin frame, less origin
    std::vector<Vector3> normals;      // outward, unit
    std::vector<std::uint8_t> on_rim;  // 1 where the surface ends and a counterpart may lie beyond
    std::vector<std::uint8_t> lifted;  // 1 for lift-offs: they take no part in the fit
    std::vector<std::array<std::uint32_t, 3>> triangles;  // of a mesh
    PointIndex index;                                     // over all points
    double spacing_mm = 0;                                // median distance to the sixth neighbour
    double thickness_mm = 0;  // least standard deviation over directions
    long given = 0, not_finite = 0, repeated = 0, lift_offs = 0;
};

// Errors: too few points, units that cannot be mm, points on a line or in a plane.
Result<TargetSurface> prepare_target(const Surface& surface, const TargetOptions& options = {});

}  // namespace sonocase::pipeline
