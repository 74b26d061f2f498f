// SPDX-License-Identifier: Apache-2.0

// The grid of cubic voxels that a registered label map is resampled into.
#pragma once

#include "formats/base/result.h"
#include "formats/registration/registration.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

struct CookedGridOptions {
    double voxel_mm = 1;   // edge of the cubic voxels, [0.2, 10]
    double margin_mm = 4;  // air kept around the body, [0, 1000]
};

// Axes of `mannequin` (direction is the identity), origin at a whole multiple of voxel_mm, just
// large enough for the warped image of every voxel with a label other than outside, plus the
// margin. Error: options out of range, a map without a body, or more than 2^31 voxels.
Result<Grid> cooked_grid(const LabelVolume& ct_labels,
                         const Registration& registration,
                         const CookedGridOptions& options = {});

// The registration with ct_box grown by half a voxel on each side: the fit usually proves the map
// on a box that ends at the centres of the CT's outermost voxels, which themselves reach further.
Registration with_voxel_rim(const Registration& registration, const Grid& ct_grid);

}  // namespace sonocase::pipeline
