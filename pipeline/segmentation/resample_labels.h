// From the patient to the mannequin: a label map on any grid in `ct`, through the inverse of the
// fitted map, into cubic voxels in `mannequin`.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/brick_volume.h"
#include "formats/label_volume.h"
#include "formats/registration.h"
#include "formats/result.h"
#include "formats/stage_report.h"
#include "pipeline/progress.h"
#include "pipeline/segmentation/label_changes.h"

namespace sonocase::pipeline {

struct ResampleInput {
    const LabelVolume& ct_labels;  // `ct`, any spacing and orientation
    const Registration& registration;
};

struct ResampleOptions {
    double voxel_mm = 1;   // edge of the cubic voxels, [0.2, 10]
    double margin_mm = 4;  // air kept round the body
};

struct ResampleResult {
    LabelVolume volume;                   // `mannequin`, direction the identity
    BrickVolume<std::uint32_t> boundary;  // formats/boundary_record.h; empty: none made
    std::vector<LabelChange> changes;     // against the CT's volumes times det J
    StageReport report;
};

// Errors: no body in the map, voxel edge out of range, a grid of more than 2^31 voxels.
Result<ResampleResult> resample_labels(const ResampleInput& input,
                                       const ResampleOptions& options = {},
                                       const Progress& progress = {});

}  // namespace sonocase::pipeline
