// SPDX-License-Identifier: Apache-2.0

// The paper's smoothing: one level set per label, eq. (10), recomposed by the smallest phi.
//
//     phi_{t+1} = phi_t + dt * (K0 * (phi_0 - phi_t) + C(x'))
//
// phi_0  signed distance to the label (negative inside), mm
// C      sum of the principal curvatures, 1/mm (positive on a sphere), at the voxel, or with
//        closest_point at x' = x - phi grad(phi), the nearest point of the surface
// K0     how closely the result follows the input, 1/mm^2 (the unit of time is mm^2)
//
// Source: [Magee] eq. (10). Departures: the printed equation lacks `phi_t +` and prints the time
// step as a gradient; layers are recomposed by the argmin of phi, because independent thresholds at
// 0 leave gaps and overlaps. Known damage: at convergence a tube of radius R survives only if R >=
// 2 / sqrt(K0), and a sphere only if R >= sqrt(8 / K0). smooth_labels.h preserves both; this is
// kept for comparison.
//
// Cost: 10 to 30 ns per voxel of the band, label and iteration; memory: 3 floats per voxel of the
// largest label's box and 5 bytes per voxel of the volume.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/segmentation/label_changes.h"

namespace sonocase::pipeline::inline segmentation {

struct LevelSetOptions {
    double k0 = 0.3;            // > 0
    int iterations = 40;        // >= 1
    double time_step = 0;       // 0: 0.8 of the largest stable step
    bool closest_point = true;  // curvature at the closest surface point, as printed
    double band_vx = 4;         // half-width of the band that moves, voxels, >= 3
};

// Largest stable time step, mm^2. Above it the iteration oscillates, and its result is wrong
// without any NaN.
double max_stable_step(double k0, double voxel_mm);

struct LevelSetResult {
    LabelVolume volume;
    std::vector<LabelChange> changes;
    double time_step = 0;
    StageReport report;
};

// Error: voxels that are not cubic (spacings equal to within 1e-6), as the paper requires, or a
// time step above the limit. Same bytes for any number of threads.
Result<LevelSetResult> level_set_smoothing(const LabelVolume& volume,
                                           const LevelSetOptions& options = {},
                                           const Progress& progress = {});

}  // namespace sonocase::pipeline::inline segmentation
