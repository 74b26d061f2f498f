// SPDX-License-Identifier: Apache-2.0

// A smooth scalar field on a coarser grid over a label volume, for distances without fine detail.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline anatomy {

// Values at every step-th voxel, starting at voxel 0. Trilinear interpolation between them, the
// nearest value beyond the last.
struct CoarseField {
    int step = 1;  // voxels
    Int3 size{0, 0, 0};
    std::vector<float> value;  // # product of size, x fastest

    std::size_t index(int i, int j, int k) const {
        return i + static_cast<std::size_t>(size.x) * (j + static_cast<std::size_t>(size.y) * k);
    }
    float at(float i, float j, float k) const;          // voxel coordinates of the fine grid
    Vector3 gradient(float i, float j, float k) const;  // per fine voxel, over one coarse step
};

// A coarse field over the bounding box of one organ.
struct LocalField {
    Int3 lower{0, 0, 0};     // first voxel of the box
    Int3 upper{-1, -1, -1};  // last voxel
    CoarseField field;
    bool contains(int i, int j, int k) const {
        return i >= lower.x && j >= lower.y && k >= lower.z && i <= upper.x && j <= upper.y &&
               k <= upper.z;
    }
    float at(int i, int j, int k) const {  // voxel of the volume
        return field.at(static_cast<float>(i - lower.x), static_cast<float>(j - lower.y),
                        static_cast<float>(k - lower.z));
    }
};

// Euclidean distance, in voxels of the fine grid, to the nearest voxel that is not `inside`; 0
// outside. Faces of the grid do not count as outside. Smoothed once by 1 2 1. Accurate to about
// half a step. Source: squared distance transform of Felzenszwalb and Huttenlocher (2012).
// inside: thread-safe.
CoarseField distance_inside(Int3 fine_size,
                            int step,
                            const std::function<bool(int i, int j, int k)>& inside);

// Works in place: squared distance, in samples, to the nearest sample that is 0; the other samples
// hold a large positive value.
void squared_distance_transform(std::vector<float>& samples, Int3 size);

}  // namespace sonocase::pipeline::inline anatomy
