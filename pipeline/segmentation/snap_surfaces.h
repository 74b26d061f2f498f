// SPDX-License-Identifier: Apache-2.0

// Brings the surfaces inside bricks onto quadrics (formats/volume/surface_patch.h) wherever one
// says the same to within a few hundredths of a voxel, so that a bundle can keep coefficients
// instead of 64 labels and records. Voxels that no quadric hits (edges, thin structures, noise)
// stay as they are.
#pragma once

#include <cstddef>
#include <cstdint>

#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::pipeline {

struct SnapOptions {
    double band_vx = 1.5;       // records exist up to this distance
    double distance_vx = 0.07;  // the most that a record's distance may change, voxels; where
                                // voxels are smaller than 1 mm as many mm, up to 0.2 voxels
    double normal_deg = 8;      // and its normal; half as much again below 0.6 mm
    int patch_step = 1;         // of the quadrics' coefficients; twice as much below 0.6 mm
};

struct SnapReport {
    std::size_t bricks = 0;      // that hold records
    std::size_t snapped = 0;     // of them, in all their voxels
    std::size_t missed = 0;      // records of the others that stay as they were
    std::size_t labels = 0;      // voxels that changed sides: closer than distance_vx to a surface
    double distance_rms_vx = 0;  // change, over the records that did
    double normal_rms_deg = 0;
};

// boundary: of the volume's size, as sample_label_field makes it; its patches are set. Same bytes
// for any number of threads. Cost: 5 us a brick with records.
SnapReport snap_surfaces(LabelVolume* volume,
                         BoundaryBricks* boundary,
                         const SnapOptions& options = {});

// record_bricks, snapped_bricks, snap_missed, snap_labels, snap_rms_vx, snap_rms_deg
void add_measures(const SnapReport& snapped, StageReport* report);

}  // namespace sonocase::pipeline
