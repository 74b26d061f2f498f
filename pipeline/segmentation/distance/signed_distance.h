// SPDX-License-Identifier: Apache-2.0

// Signed distance to one label of a label volume, or to the union of several, in a box of voxels
// and up to a limit.
//
// phi < 0 inside the label, > 0 outside, in mm: the exact Euclidean distance between voxel centres
// minus half a voxel, clamped to +-limit_mm. The surface is thus half-way between a voxel of the
// label and its neighbour outside. Where `axes` is false along the axis of a stack of thick slices,
// each slice is measured on its own, as shape interpolation requires. A label that reaches the
// border of the volume is assumed to continue beyond it: no surface runs along the border. Cost:
// O(limit / spacing) per voxel and axis, vectorised; deterministic.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/base/label_set.h"

namespace sonocase::pipeline::inline segmentation_distance {

// A box of voxels of a grid: first, first + 1, ... first + size - 1 along each axis.
struct VoxelBox {
    Int3 first{0, 0, 0};
    Int3 size{0, 0, 0};
    bool empty() const { return size.x <= 0 || size.y <= 0 || size.z <= 0; }
    std::size_t count() const {
        return empty() ? 0 : static_cast<std::size_t>(size.x) * size.y * size.z;
    }
    std::size_t index(int i, int j, int k) const {  // of a voxel relative to first
        return i + static_cast<std::size_t>(size.x) * (j + static_cast<std::size_t>(size.y) * k);
    }
};

// The bounding box of each label, # labels; empty for a label without voxels.
std::vector<VoxelBox> label_boxes(const LabelVolume& volume);

// `box` grown by `voxels` on each side and cut to the volume.
VoxelBox grow(const VoxelBox& box, Int3 voxels, Int3 size);

// Scratch space, for callers that measure again and again: newly allocated memory is slow.
struct DistanceSpace {
    std::vector<float>*first, *second;
};

// phi: # box.count(), x fastest. limit_mm > 0.
void signed_distance(const LabelVolume& volume,
                     const LabelSet& labels,
                     const VoxelBox& box,
                     double limit_mm,
                     std::array<bool, 3> axes,
                     std::vector<float>* phi,
                     DistanceSpace space);
void signed_distance(const LabelVolume& volume,
                     const LabelSet& labels,
                     const VoxelBox& box,
                     double limit_mm,
                     std::array<bool, 3> axes,
                     std::vector<float>* phi);
// The same for one label.
void signed_distance(const LabelVolume& volume,
                     std::uint8_t label,
                     const VoxelBox& box,
                     double limit_mm,
                     std::array<bool, 3> axes,
                     std::vector<float>* phi);

}  // namespace sonocase::pipeline::inline segmentation_distance
