// SPDX-License-Identifier: Apache-2.0

// A lesion whose place is known: its surface and parts, painted.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/pathology/pathology_kinds.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/pathology.h"

namespace sonocase::pipeline {

struct Lesion {
    VoxelRange range;     // holds its surface
    VoxelField distance;  // signed, voxels
    Vector3 centre_vx;
    double radius_vx = 1;  // of the ball of its volume
    Vector3 down;          // gravity, unit, in the grid's frame
    Labels into;           // labels that it replaces
};

struct PaintedLesion {
    Labels inside;                     // its own label and those of its inner parts
    std::vector<std::string> skipped;  // parts thinner than three quarters of a voxel
};

// Outer parts first, then the lesion, then what lies in it. Error: no room in the palette.
Result<PaintedLesion> paint_lesion(LabelCanvas& canvas,
                                   const Lesion& lesion,
                                   const PathologyRequest& request,
                                   const PathologyKind& kind);

// Millimetres that the parts that can be drawn add outside the lesion's surface.
double shell_mm(const PathologyRequest& request, const PathologyKind& kind, double voxel_mm);

}  // namespace sonocase::pipeline
