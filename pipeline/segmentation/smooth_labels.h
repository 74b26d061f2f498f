// SPDX-License-Identifier: Apache-2.0

// Smoothing of a label volume, all labels at once.
//
// joint      the labels become one smooth partition of space in which every label keeps its volume
//            (label_field.h, volume_correction.h), read back on the same voxels, with boundary records.
//            No gap, no overlap and no lost label is possible. On thick slices the steps stay steps
//            of whole voxels; resample_labels.h is what makes cubic voxels of them.
// level_set  the paper's eq. (10) per label (level_set_smoothing.h): cubic voxels only, no records.
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

namespace sonocase::pipeline {

struct SmoothOptions {
    std::string method = "joint";  // joint | level_set
    double sigma_vx = 1.5;         // joint: voxels, [0, 4]
    double detail_vx = 0.5;        // joint: smoothing of what sigma_vx would wipe out, [0, 4]
    int iterations = 1;            // joint: times over, [1, 20]
    int volume_iterations = 8;     // joint: Newton steps of the volumes, [0, 50]; 0: not kept
    double record_band_vx = 1.5;   // joint: boundary records up to this distance, [0, 2.6]; 0: none
    double snap_vx = 0.07;         // joint: as in resample_labels.h
    LevelSetOptions level_set;
};

// Raised whenever the same input and options give other bytes than before.
inline constexpr int kSmoothVersion = 7;

struct SmoothResult {
    LabelVolume volume;       // on the grid of the input
    BoundaryBricks boundary;  // formats/volume/boundary_record.h; empty: none made
    std::vector<LabelChange> changes;
    StageReport report;
};

Result<SmoothResult> smooth_labels(const LabelVolume& volume,
                                   const SmoothOptions& options = {},
                                   const Progress& progress = {});

}  // namespace sonocase::pipeline
