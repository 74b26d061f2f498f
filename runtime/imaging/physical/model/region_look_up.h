// SPDX-License-Identifier: Apache-2.0

// The part of a case that is given on smaller voxels (formats/volume/fine_region.h), laid out for
// the frame loop.
//
// A sample whose point, before its random step, lies in the region's box takes its label from the
// region, and its surface too where the voxel holds one. Farther from a surface than the region's
// records reach, the case's own record stays, if it begins at the same label, with a distance of at
// least 0: surfaces are then drawn equally wide on both sides of the border, and roughness and
// pulse move them equally far. Everything else (echo offsets, contact, sheets of the wall,
// streaks, the diaphragm) comes from the case's own volume everywhere, so that only the place of
// surfaces can differ at the border.
#pragma once

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "runtime/imaging/physical/model/brick_table.h"

namespace sonocase::runtime {

// Where a region lies in its case.
struct RegionPlace {
    Point3 lower_vx, upper_vx;  // the box, in voxel coordinates of the case
    // Voxel coordinates of the region: per_voxel * those of the case + first.
    double per_voxel = 1;
    Vector3 first;

    bool contains(Point3 v) const {
        return v.x >= lower_vx.x && v.y >= lower_vx.y && v.z >= lower_vx.z && v.x < upper_vx.x &&
               v.y < upper_vx.y && v.z < upper_vx.z;
    }
    Point3 voxel_of(Point3 v) const {
        return {per_voxel * v.x + first.x, per_voxel * v.y + first.y, per_voxel * v.z + first.z};
    }
};

RegionPlace region_place(const FineRegion& region, const Grid& case_grid);

struct RegionLookUp {
    const FineRegion* region = nullptr;  // null: the case has none
    BrickTable words;                    // filled in completely
    RegionPlace place;
};

// Marks the case's bricks in which a look-up can find something else in the region than in the
// case, with room for the random steps; all others are one label without a surface in both. Cost:
// 30 ms for a region of 20 million voxels.
BrickMarks marks_of_region(const CaseBundle& bundle);

// The bundle must outlive it. Error: too little memory.
Result<RegionLookUp> make_region_look_up(const CaseBundle& bundle, JobRunner& jobs);

}  // namespace sonocase::runtime
