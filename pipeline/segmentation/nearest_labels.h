// SPDX-License-Identifier: Apache-2.0

// The paper's resampling: each voxel takes the label of the CT voxel nearest to its preimage. Kept
// for comparison and as the first half of the paper's method; resample_labels.h is more accurate.
#pragma once

#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline segmentation {

struct PreimageCounts {
    std::size_t outside = 0;      // voxels whose preimage lies outside the CT
    std::size_t no_preimage = 0;  // voxels for which the inversion finds no preimage
};

// Labels of `grid` (in `mannequin`) from `ct_labels` through the inverse of the map. Voxels without
// a preimage inside the CT are outside (0) and counted; counts may be null. Cost: one inversion per
// voxel. Same bytes for any number of threads.
LabelVolume nearest_labels(const LabelVolume& ct_labels,
                           const Registration& registration,
                           const Grid& grid,
                           PreimageCounts* counts,
                           const Progress& progress = {});

// Volume that each label should have after the map, ml: its CT voxels times det J. # labels.
// det J is taken for runs of four voxels along x, in maps of more than `many` for boxes of some
// 12 x 3 x 3 mm.
std::vector<double> mapped_volumes_ml(const LabelVolume& ct_labels,
                                      const Registration& registration,
                                      std::size_t many = 30'000'000);

}  // namespace sonocase::pipeline::inline segmentation
