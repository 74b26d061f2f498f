// SPDX-License-Identifier: Apache-2.0

// Reads a label field on a grid of cubic voxels: labels, and boundary records near every surface.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/segmentation/field/label_field.h"
#include "pipeline/segmentation/field/nearest_labels.h"

namespace sonocase::pipeline {

// How the voxels of the grid lie in the frame of the field.
struct FieldMap {
    // Frame positions of voxels (0..size.x-1, j, k), structure of arrays. Thread-safe.
    std::function<void(int j, int k, float* x, float* y, float* z, MapStatus* status)> row;
    // d(frame) / d(grid's frame) at a frame point.
    std::function<Matrix3(Point3 frame)> jacobian;
    // Grid frame from field frame, for the guard of lost labels.
    std::function<Point3(Point3 frame)> forward;
};

struct FieldReadOptions {
    double record_band_vx = 1.5;  // records where a surface is within this, [0, 2.6]; 0: none
};

struct SampledField {
    LabelVolume volume;
    BoundaryBricks boundary;
    PreimageCounts counts;
    std::vector<int> rescued;  // labels too small for the grid, kept as one voxel
    std::vector<int> lost;     // labels whose place lies outside the grid
};

// The field's labels that have voxels in the source and none in the answer are put back as the one
// voxel where they come nearest to winning. Same bytes for any number of threads.
// Sets the field's contests for the band of the records.
SampledField sample_label_field(LabelField* field,
                                const Grid& grid,
                                const FieldMap& map,
                                const FieldReadOptions& options,
                                const Progress& progress = {});

}  // namespace sonocase::pipeline
