// SPDX-License-Identifier: Apache-2.0

// From the patient to the mannequin: resamples a label map on any grid in `ct`, through the inverse
// of the registration, into cubic voxels in `mannequin`. Methods:
//
// shape    The labels become one smooth partition of space (label_field.h): thick slices are
//          interpolated by shape, steps are smoothed, and every label keeps its volume
//          (volume_correction.h). The partition is evaluated at the preimage of each voxel;
//          near a surface, a boundary record says where the surface runs within the voxel.
// nearest  The paper's: the label of the nearest CT voxel; no records.
// paper    `nearest`, then the level sets of eq. (10) per label (level_set_smoothing.h).
//
// A label whose anatomy is smaller than a voxel is kept as one voxel and named in the report. Cost
// of `shape`: real torso (1.4 M voxels of 3 mm, 67 labels) into 1 mm, about 8 s of processor time
// and 0.34 GB; maps of tens of millions of voxels are measured in tiles, and distances come and go
// by layers where memory is short (docs/farm.md). Same bytes for any number of threads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/label_changes.h"
#include "pipeline/segmentation/level_set_smoothing.h"

namespace sonocase::pipeline::inline segmentation {

struct ResampleInput {
    const LabelVolume& ct_labels;  // `ct`, any spacing and orientation
    const Registration& registration;
};

struct ResampleOptions {
    double voxel_mm = 1;           // edge of the cubic voxels, [0.2, 10]
    double margin_mm = 4;          // air kept around the body, [0, 1000]
    std::string method = "shape";  // shape | nearest | paper
    double sigma_vx = 1.7;         // shape: smoothing, in-plane voxels of the map, [0, 4]
    double detail_vx = 0.5;        // shape: smoothing of what sigma_vx would remove, [0, 4]
    double sigma_slices = 0;       // shape: smoothing across thick slices, in slices; 0: automatic
    int volume_iterations = 8;     // shape: Newton steps of the volumes, [0, 50]; 0: not corrected
    bool follow_shift = true;      // shape: follow oblique vessels from slice to slice
    double record_band_vx = 1.5;   // shape: boundary records up to this distance, [0, 2.6]; 0: none
    double snap_vx = 0.07;         // shape: how far surfaces may move onto quadrics; 0: not at all
    int block_vx = 8;              // shape: nodes per edge of a block of distances: 4, 8 or 16
    // shape: distances held at a time, MB, besides what else is needed. Less takes longer, since
    // layers of the map are measured again when they come back; the bytes are the same.
    double held_mb = 1e9;
    LevelSetOptions level_set;            // paper
    std::optional<RegionRequest> region;  // shape: cooked on smaller voxels as well
};

// Incremented whenever the same input and options give different bytes.
inline constexpr int kResampleVersion = 9;

struct ResampleSeconds {  // method shape; wall clock
    double distances = 0, volumes = 0, voxels = 0, region = 0;
};

struct ResampleResult {
    LabelVolume volume;                // `mannequin`, direction the identity
    BoundaryBricks boundary;           // formats/volume/boundary_record.h; empty: no records
    std::optional<FineRegion> region;  // the same partition of space, on its own grid
    std::vector<LabelChange> changes;  // against the CT's volumes times det J
    StageReport report;
    ResampleSeconds seconds;  // not in the report, whose measures are part of the stage's bytes
};

// Error: no body in the map, voxel edge or margin out of range, a grid of more than 2^31 voxels, an
// unknown method or edge of blocks, a region that region_box() refuses or that the method cannot
// cook.
Result<ResampleResult> resample_labels(const ResampleInput& input,
                                       const ResampleOptions& options = {},
                                       const Progress& progress = {});

}  // namespace sonocase::pipeline::inline segmentation
