// SPDX-License-Identifier: Apache-2.0

// A box of a case in which labels and surfaces are given on smaller voxels as well.
//
// The case's own volume is complete without it. Inside the box, a reader that knows the region
// takes from it the labels and the surfaces within reach of its voxels, and everything else (echo
// offsets, surfaces farther away) from the case's own volume. docs/format.md, part 2.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"

namespace sonocase {

// The grid reaches at least this many of its voxels beyond the box, so that a look-up at a random
// step from a point of the box stays inside.
inline constexpr int kRegionRim = 4;
inline constexpr double kMinRegionVoxelMm = 0.1;

struct FineRegion {
    std::string name;
    Box3 box;   // `mannequin`
    Grid grid;  // cubic voxels of `mannequin`, smaller than the case's; direction is the identity
    BrickVolume<std::uint8_t> label_bricks;  // palette of the case
    BoundaryBricks boundary;                 // empty: no records
};

// The grid of a region: its first voxel is centred on a whole multiple of voxel_mm.
Grid region_grid(const Box3& box, double voxel_mm);

// Error: a box that is empty or not finite; voxels that are not cubes, below 0.1 mm or not smaller
// than case_voxel_mm; a grid without the rim round the box. The volumes are not checked.
Status check_region(const FineRegion& region, double case_voxel_mm, const std::string& where);

}  // namespace sonocase
