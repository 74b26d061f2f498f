// SPDX-License-Identifier: Apache-2.0

// Paints a lesion whose place is known: its surface and its parts.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/pathology/pathology_kinds.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/place_pathology.h"

namespace sonocase::pipeline::inline pathology {

struct Lesion {
    VoxelRange range;     // holds its surface
    VoxelField distance;  // signed, voxels
    Vector3 centre_vx;
    double radius_vx = 1;  // of the ball of its volume
    Vector3 down;          // gravity, unit, in the grid's frame
    LabelSet into;         // labels that it replaces
};

struct PaintedLesion {
    LabelSet inside;                   // its own label and those of its inner parts
    std::vector<std::string> skipped;  // parts thinner than three quarters of a voxel
};

// Paints the outer parts first, then the lesion, then the parts inside. Error: no room in the
// palette.
Result<PaintedLesion> paint_lesion(LabelCanvas& canvas,
                                   const Lesion& lesion,
                                   const PathologyRequest& request,
                                   const PathologyKind& kind);

// Thickness that the parts which can be drawn add outside the lesion's surface, mm.
double shell_mm(const PathologyRequest& request, const PathologyKind& kind, double voxel_mm);

}  // namespace sonocase::pipeline::inline pathology
