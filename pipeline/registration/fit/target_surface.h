// SPDX-License-Identifier: Apache-2.0

// The mannequin's surface, prepared for matching: a mesh, or a cloud of readings with planes fitted
// through neighbours. Coordinates are relative to `origin`, so that far frames lose no accuracy.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"
#include "pipeline/registration/fit/point_index.h"

namespace sonocase::pipeline::inline registration_fit {

struct TargetOptions {
    int neighbours = 12;  // that define the plane through a reading, >= 6
    // A reading farther than this from the plane of its neighbours was taken in the air.
    double lift_off_mm = 8;
    // Readings of the table that the mannequin lies on are recognised and left out.
    bool find_table = true;
};

// What a sweep touched beside the mannequin.
struct Table {
    bool found = false;
    Point3 place;    // on the plane, relative to the target's origin
    Vector3 normal;  // unit, towards the mannequin
    long readings = 0;
};

struct TargetSurface {
    Point3 origin;                     // mannequin frame
    std::vector<Point3> points;        // mannequin frame, relative to origin
    std::vector<Vector3> normals;      // outward, unit
    std::vector<std::uint8_t> on_rim;  // 1 where the surface ends; the counterpart may lie beyond
    std::vector<std::uint8_t> lifted;  // 1 for lift-offs, which the fit does not use
    std::vector<std::uint32_t> given_as;  // # points, their numbers in the surface given
    std::vector<std::array<std::uint32_t, 3>> triangles;  // of a mesh
    PointIndex index;                                     // over all points
    double spacing_mm = 0;                                // median distance to the sixth neighbour
    double thickness_mm = 0;  // smallest standard deviation over directions
    Table table;              // its readings are not among the points
    long given = 0, not_finite = 0, repeated = 0, lift_offs = 0;
};

// Errors: too few points (beside those of the table), units that cannot be mm, points on a line or
// in a plane.
Result<TargetSurface> prepare_target(const Surface& surface, const TargetOptions& options = {});

}  // namespace sonocase::pipeline::inline registration_fit
