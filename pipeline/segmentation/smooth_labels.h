// SPDX-License-Identifier: Apache-2.0

// Smoothing of a label volume, all labels at once. Methods:
//
// joint      The labels become one smooth partition of space in which every label keeps its volume
//            (label_field.h, volume_correction.h), evaluated on the same voxels, with
//            boundary records. Gaps, overlaps and lost labels are impossible. On thick slices the
//            steps remain steps of whole voxels; resample_labels.h makes cubic voxels of them.
// level_set  The paper's eq. (10) per label (level_set_smoothing.h): cubic voxels only, no records.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/progress.h"
#include "pipeline/segmentation/label_changes.h"
#include "pipeline/segmentation/level_set_smoothing.h"

namespace sonocase::pipeline::inline segmentation {

struct SmoothOptions {
    std::string method = "joint";  // joint | level_set
    double sigma_vx = 1.5;         // joint: voxels, [0, 4]
    double detail_vx = 0.5;        // joint: smoothing of what sigma_vx would remove, [0, 4]
    int iterations = 1;            // joint: repetitions, [1, 20]
    int volume_iterations = 8;     // joint: Newton steps of the volumes, [0, 50]; 0: not corrected
    double record_band_vx = 1.5;   // joint: boundary records up to this distance, [0, 2.6]; 0: none
    double snap_vx = 0.07;         // joint: as in resample_labels.h
    LevelSetOptions level_set;
};

// Incremented whenever the same input and options give different bytes.
inline constexpr int kSmoothVersion = 7;

struct SmoothResult {
    LabelVolume volume;       // on the grid of the input
    BoundaryBricks boundary;  // formats/volume/boundary_record.h; empty: no records
    std::vector<LabelChange> changes;
    StageReport report;
};

// Error: an unknown method, or those of level_set_smoothing. A volume whose voxels are not cubic is
// smoothed without boundary records, and the report warns of it. Same bytes for any number of
// threads.
Result<SmoothResult> smooth_labels(const LabelVolume& volume,
                                   const SmoothOptions& options = {},
                                   const Progress& progress = {});

}  // namespace sonocase::pipeline::inline segmentation
