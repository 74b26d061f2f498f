// SPDX-License-Identifier: Apache-2.0

// From the patient to the mannequin: a label map on any grid in `ct`, through the inverse of the
// fitted map, into cubic voxels in `mannequin`.
//
// shape    the labels become one smooth partition of space (label_field.h): thick slices are
//          interpolated by shape, steps smoothed, every label at its own volume (volume_correction.h).
//          It is read at the preimage of each voxel, and near a surface a boundary record says
//          where
//          it runs inside the voxels.
// nearest  the paper's: the label of the nearest CT voxel; no records.
//
// paper    nearest, then the level sets of eq. (10) on every label (level_set_smoothing.h).
//
// Labels whose anatomy is smaller than a voxel are kept as one voxel and named in the report. Cost:
// real torso (1.4 M voxels of 3 mm, 67 labels) into 1 mm about 9 s of processor time, 0.34 GB.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/registration/registration.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/progress.h"
#include "pipeline/segmentation/label_changes.h"
#include "pipeline/segmentation/level_set_smoothing.h"

namespace sonocase::pipeline {

struct ResampleInput {
    const LabelVolume& ct_labels;  // `ct`, any spacing and orientation
    const Registration& registration;
};

struct ResampleOptions {
    double voxel_mm = 1;           // edge of the cubic voxels, [0.2, 10]
    double margin_mm = 4;          // air kept round the body
    std::string method = "shape";  // shape | nearest | paper
    double sigma_vx = 1.7;         // shape: smoothing, voxels of the map in the plane, [0, 4]
    double detail_vx = 0.5;        // shape: smoothing of what sigma_vx would wipe out, [0, 4]
    double sigma_slices = 0;       // shape: along thick slices, slices; 0: label_distance.h
    int volume_iterations = 8;     // shape: Newton steps of the volumes, [0, 50]; 0: not kept
    bool follow_shift = true;      // shape: oblique vessels through thick slices
    double record_band_vx = 1.5;   // shape: boundary records up to this distance, [0, 2.6]; 0: none
    double snap_vx = 0.07;         // shape: surfaces may move so far to be kept short; 0: none
    int block_vx = 8;              // shape: edge of the blocks of distances, nodes: 4, 8 or 16
    LevelSetOptions level_set;     // paper
};

// Raised whenever the same input and options give other bytes than before.
inline constexpr int kResampleVersion = 9;

struct ResampleSeconds {  // method shape; wall clock
    double distances = 0, volumes = 0, voxels = 0;
};

struct ResampleResult {
    LabelVolume volume;                // `mannequin`, direction the identity
    BoundaryBricks boundary;           // formats/volume/boundary_record.h; empty: none made
    std::vector<LabelChange> changes;  // against the CT's volumes times det J
    StageReport report;
    ResampleSeconds seconds;  // not in the report: its measures are part of the stage's bytes
};

// Errors: no body in the map, voxel edge out of range, a grid of more than 2^31 voxels, another
// method or edge of blocks than those named.
Result<ResampleResult> resample_labels(const ResampleInput& input,
                                       const ResampleOptions& options = {},
                                       const Progress& progress = {});

}  // namespace sonocase::pipeline
