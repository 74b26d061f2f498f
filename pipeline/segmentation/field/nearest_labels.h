// SPDX-License-Identifier: Apache-2.0

// The resampling of the paper: each voxel takes the label of the CT voxel nearest to where it came
// from. Kept for comparison and as the first half of the paper's mode; resample_labels.h is better.
#pragma once

#include "formats/registration/registration.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline {

struct PreimageCounts {
    std::size_t outside = 0;      // voxels whose preimage lies outside the CT
    std::size_t no_preimage = 0;  // voxels that come from nowhere
};

// Labels of `grid` (in `mannequin`) from `ct_labels` through the inverse of the map. Voxels without
// a preimage inside the CT are outside (0) and counted. One inversion a voxel; any number of
// threads gives the same bytes.
LabelVolume nearest_labels(const LabelVolume& ct_labels,
                           const Registration& registration,
                           const Grid& grid,
                           PreimageCounts* counts,
                           const Progress& progress = {});

// The volume in ml that each label should have after the map: its CT voxels times det J. # labels.
std::vector<double> mapped_volumes_ml(const LabelVolume& ct_labels,
                                      const Registration& registration);

}  // namespace sonocase::pipeline
