// SPDX-License-Identifier: Apache-2.0

// The smoothing of the paper: one level set a label, eq. (10), recomposed by the smallest phi.
//
//     phi_{t+1} = phi_t + dt * (K0 * (phi_0 - phi_t) + C(x'))
// phi_0  signed distance to the label (negative inside), mm
// C      sum of the principal curvatures, 1/mm (positive on a sphere), at the voxel, or with
//        closest_point at x' = x - phi grad(phi): the point of the surface nearest to it
// K0     how closely the answer keeps to the input, 1/mm^2 (the time unit is mm^2)
//
// Source: [Magee] eq. (10). Departures: the printed equation lacks `phi_t +` and prints the time
// step as a gradient; layers are recomposed by argmin of phi instead of thresholding each at 0,
// because independent thresholds leave gaps and overlaps. Known harm: at convergence a tube of
// radius R survives only if R >= 2 / sqrt(K0), a sphere only if R >= sqrt(8 / K0). smooth_labels.h
// keeps them; this stays for comparison. Cost: 10-30 ns a voxel of the band, label and iteration;
// memory 3 floats a voxel of the largest label's box and 5 bytes a voxel of the volume.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/segmentation/label_changes.h"

namespace sonocase::pipeline {

struct LevelSetOptions {
    double k0 = 0.3;            // > 0
    int iterations = 40;        // >= 1
    double time_step = 0;       // 0: 0.8 of the greatest stable step
    bool closest_point = true;  // curvature at the closest surface point, as printed
    double band_vx = 4;         // half width of the band that moves, voxels, >= 3
};

// Above this the iteration oscillates and its answer is garbage without a NaN to show it.
double greatest_stable_step(double k0, double voxel_mm);

struct LevelSetResult {
    LabelVolume volume;
    std::vector<LabelChange> changes;
    double time_step = 0;
    StageReport report;
};

// Cubic voxels are required (spacings within 1e-6 of each other), as in the paper; else an Error
// that says to resample first. A time step above the limit is an Error too.
Result<LevelSetResult> level_set_smoothing(const LabelVolume& volume,
                                           const LevelSetOptions& options = {},
                                           const Progress& progress = {});

}  // namespace sonocase::pipeline
