// SPDX-License-Identifier: Apache-2.0

// Outlines of labels within the slices of a stack: 8-connected components of one label in one
// slice.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline {

struct Outline {
    int slice = 0;
    std::uint8_t label = 0;
    VoxelBox box;                   // one slice thick
    int area = 0;                   // pixels
    double x = 0, y = 0;            // centroid, pixels
    double xx = 0, xy = 0, yy = 0;  // second moments about it, pixels^2

    bool elongated() const;        // whether its direction is well defined
    double direction_rad() const;  // of the long axis, in (-pi/2, pi/2]
};

struct OutlineMap {
    std::vector<Outline> outlines;       // slice by slice
    std::vector<std::int32_t> of_voxel;  // # voxels: index into outlines
};

// Slices are along k. Cost: one pass over the voxels.
OutlineMap find_outlines(const LabelVolume& volume);

}  // namespace sonocase::pipeline
