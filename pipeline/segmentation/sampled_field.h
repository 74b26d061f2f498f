// SPDX-License-Identifier: Apache-2.0

// Samples a label field on a grid of cubic voxels: labels, and boundary records near every surface.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/segmentation/label_field.h"
#include "pipeline/segmentation/nearest_labels.h"

namespace sonocase::pipeline::inline segmentation {

// Where the voxels of the grid lie in the frame of the field. All three are thread-safe.
struct FieldMap {
    // Positions, in the field's frame, of voxels (0..size.x-1, j, k), structure of arrays.
    std::function<void(int j, int k, float* x, float* y, float* z, MapStatus* status)> row;
    // d(field frame) / d(grid frame) at a point of the field's frame.
    std::function<Matrix3(Point3 frame)> jacobian;
    // Grid frame from field frame; used to restore lost labels.
    std::function<Point3(Point3 frame)> forward;
};

struct FieldSamplingOptions {
    double record_band_vx = 1.5;  // records within this distance of a surface, [0, 2.6]; 0: none
    bool keep_labels = true;      // restore labels that the grid is too coarse for
};

struct SampledField {
    LabelVolume volume;
    BoundaryBricks boundary;
    PreimageCounts counts;
    std::vector<int> rescued;  // labels too small for the grid, kept as one voxel
    std::vector<int> lost;     // labels whose location is outside the grid
};

// With keep_labels a label with voxels in the source but none in the result is restored as one
// voxel, the one where it comes nearest to winning. Calls field->find_candidates() for the band of
// the records. Same bytes for any number of threads.
SampledField sample_label_field(LabelField* field,
                                const Grid& grid,
                                const FieldMap& map,
                                const FieldSamplingOptions& options,
                                const Progress& progress = {});

}  // namespace sonocase::pipeline::inline segmentation
