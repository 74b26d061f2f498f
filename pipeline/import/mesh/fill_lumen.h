// SPDX-License-Identifier: Apache-2.0

// The inside of pipes. A pipe with a wall (vessel, bowel, ureter) is open to the outside, so that
// neither caps nor holes of the solid fill it; its slices are rings, which do.
#pragma once

#include "pipeline/import/mesh/winding_voxels.h"

namespace sonocase::pipeline {

struct LumenOptions {
    double voxel_mm = 1;
    double hole_mm2 = 900;  // largest hole of a slice that is lumen
};

// The wall grown by a voxel closes small gaps; holes of the slices along each of the three axes, up
// to the area given, are lumen; they grow by the voxel again and join the wall. In place; the
// voxels added.
std::size_t fill_lumen(VoxelMask& wall, const LumenOptions& options);

}  // namespace sonocase::pipeline
