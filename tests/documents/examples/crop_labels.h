// SPDX-License-Identifier: Apache-2.0

// Cuts a label volume down to the box of its body and a margin.
#pragma once

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

inline constexpr int kCropVersion = 1;  // raised when the same input gives another output

struct CropOptions {
    double margin_mm = 5;  // kept round the body, >= 0
};

struct CropResult {
    LabelVolume volume;  // same voxels, same places, fewer of them
    StageReport report;  // measures: share_kept; warns where the body touches the input's border
};

// Labels, palette and frame stay; so does every voxel centre, to the last digit of its grid.
// Errors: a volume without a body. Cost: one pass over the voxels.
Result<CropResult> crop_labels(const LabelVolume& input, const CropOptions& options = {});

}  // namespace sonocase::pipeline
