// SPDX-License-Identifier: Apache-2.0

// Effect wall in the reference renderer.
#pragma once

#include "runtime/imaging/physical/reference/reference_input.h"

namespace sonocase::runtime {

struct WallEcho {
    double amplitude = 0;  // before Row::interface_scale
    bool in_wall = false;  // above the organs
    double ground_db = 0;
};

// Echo of the wall's sheets at a sample. voxel: of the
// sample, in the middle of the slab; below, above: of the points half a node below and above it on
// the beam, node_mm apart.
WallEcho wall_echo(
    const ReferenceInput& input, Point3 above, Point3 voxel, Point3 below, double node_mm);

}  // namespace sonocase::runtime
