// Smoothing of a label volume of cubic voxels.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/brick_volume.h"
#include "formats/label_volume.h"
#include "formats/result.h"
#include "formats/stage_report.h"
#include "pipeline/progress.h"
#include "pipeline/segmentation/label_changes.h"
#include "pipeline/segmentation/level_set_smoothing.h"

namespace sonocase::pipeline {

struct SmoothOptions {
    LevelSetOptions level_set;
};

struct SmoothResult {
    LabelVolume volume;
    BrickVolume<std::uint32_t> boundary;  // formats/boundary_record.h; empty: none made
    std::vector<LabelChange> changes;
    StageReport report;
};

Result<SmoothResult> smooth_labels(const LabelVolume& volume,
                                   const SmoothOptions& options = {},
                                   const Progress& progress = {});

}  // namespace sonocase::pipeline
