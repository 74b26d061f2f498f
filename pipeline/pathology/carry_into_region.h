// SPDX-License-Identifier: Apache-2.0

// Lesions in the fine region of a case (formats/volume/fine_region.h).
#pragma once

#include "formats/volume/fine_region.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline pathology {

struct PaintedLabels {
    const LabelVolume& volume;
    const BoundaryBricks& boundary;  // of volume; may be empty
};

// Lesions are painted on the case's own voxels. Wherever that changed a voxel's label or record,
// the region's voxels are made from the painted ones: each lies on the side of the plane in its
// voxel of the case that its centre is on, and has that plane as its record where it is within
// reach_vx of its voxels. Returns the number of the region's voxels that were changed.
std::size_t carry_into_region(const PaintedLabels& before,
                              const PaintedLabels& after,
                              double reach_vx,
                              FineRegion* region);

}  // namespace sonocase::pipeline::inline pathology
