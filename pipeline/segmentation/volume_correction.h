// SPDX-License-Identifier: Apache-2.0

// Chooses the volume offset of every label such that each label keeps its volume, all labels at
// once.
//
// Volumes are integrals over the voxels of the map. Each voxel is cut into q^3 cells, and a cell
// that the surface between its two best labels crosses is shared between them by the distance to
// that surface over the size of the cell. Volumes are then smooth functions of the offsets, and
// Newton's method on all labels at once (its matrix is the graph of the areas of the common
// surfaces) converges in a few steps. The result does not depend on the number of threads.
#pragma once

#include <functional>
#include <vector>

#include "pipeline/segmentation/label_field.h"

namespace sonocase::pipeline::inline segmentation {

struct VolumeCorrectionOptions {
    int iterations = 8;          // Newton steps; 0: all offsets stay 0
    double cell_mm = 1.5;        // size of the integration cells, at most a voxel of the map
    double max_offset_vx = 1.5;  // limit of an offset, in-plane voxels of the map
    // In fields of more nodes one node in four is read, and counts for four, in blocks that are not
    // near a label of fewer than 50,000 voxels.
    std::size_t max_read_nodes = 30'000'000;
};

struct VolumeCorrectionReport {
    std::vector<double> target_mm3;   // # labels
    std::vector<double> reached_mm3;  // by the integral
    int iterations = 0;
    double largest_error = 0;  // relative, over labels whose offset is below its limit
};

// Sets the field's volume offsets and leaves its candidates in an unspecified state: call
// find_candidates() before evaluating it.
//
// weight(point)  volume that a mm^3 of the map has after the map's deformation: det J of the
//                registration, or 1 without one; thread-safe, called once per block of the field
VolumeCorrectionReport correct_volumes(LabelField* field,
                                       const std::function<double(Point3)>& weight,
                                       const VolumeCorrectionOptions& options = {});

}  // namespace sonocase::pipeline::inline segmentation
