// SPDX-License-Identifier: Apache-2.0

// A smooth scalar field on a coarser grid over a label volume: distances that need no fine detail.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "formats/volume/grid.h"

namespace sonocase::pipeline {

// Values at every step-th voxel, starting at voxel 0; read in between by trilinear interpolation
// and beyond the last by the nearest value.
struct CoarseField {
    int step = 1;  // voxels
    Int3 size{0, 0, 0};
    std::vector<float> value;  // # product of size, x fastest

    std::size_t index(int i, int j, int k) const {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(size.x) *
                   (static_cast<std::size_t>(j) +
                    static_cast<std::size_t>(size.y) * static_cast<std::size_t>(k));
    }
    float at(float i, float j, float k) const;          // voxel coordinates of the fine grid
    Vector3 gradient(float i, float j, float k) const;  // per fine voxel, over one coarse step
};

// Euclidean distance in voxels of the fine grid to the nearest voxel that is not `inside`, by the
// squared distance transform of Felzenszwalb and Huttenlocher (2012); 0 outside. Faces of the grid
// do not count as outside. Smoothed once by 1 2 1. Exact to about half a step.
CoarseField distance_inside(Int3 fine_size,
                            int step,
                            const std::function<bool(int i, int j, int k)>& inside);

// In place: squared distance (in samples) to the nearest sample that is 0; others hold +large.
void squared_distance_transform(std::vector<float>& samples, Int3 size);

}  // namespace sonocase::pipeline
