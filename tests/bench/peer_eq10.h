// SPDX-License-Identifier: Apache-2.0

// Eq. (10) of the paper as it is printed: each label's level set over the whole grid, every voxel
// of it in every iteration. The pipeline's own mode (level_set_smoothing.h) moves a band in the
// label's box instead, to the same end.
#pragma once

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/level_set_smoothing.h"

namespace sonocase::bench {

// Cubic voxels; curvature at the closest point of the surface; recomposed by the least phi. Both
// processors share each pass. K0, iterations and time step as in `options`.
LabelVolume eq10_over_whole_grid(const LabelVolume& volume,
                                 const pipeline::LevelSetOptions& options);

}  // namespace sonocase::bench
