// SPDX-License-Identifier: Apache-2.0

// Correspondence of the outlines in successive slices of a stack of thick slices.
//
// A vessel that runs obliquely through thick slices appears at a different place in each, often
// without overlap, and blending the slices' distance fields in place turns it into a chain of
// discs. Outlines (8-connected components of one label in one slice) are therefore paired, and a
// pair that overlaps better after a shift and a rotation than in place is blended along them. An
// outline without a successor is closed by a ball: the areas of the last two slices determine its
// pole, which is half-way to the next slice if they do not shrink.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline segmentation_distance {

// An 8-connected component of one label in one slice.
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

// A pair of outlines in successive slices, or one that begins or ends.
struct SliceGroup {
    int lower = -1;                   // outline in slice k; -1: `upper` begins above slice k
    int upper = -1;                   // outline in slice k + 1; -1: `lower` ends above slice k
    int slice = 0;                    // k
    double shift_x = 0, shift_y = 0;  // from the lower to the upper, pixels
    double turn_rad = 0;              // from the lower to the upper, about the centroid
    double end = 0.5;                 // if one of them is -1: pole beyond the other, in slices
};

struct SliceGroups {
    OutlineMap outlines;
    // # labels; only groups for which blending the slices in place is not enough.
    std::vector<std::vector<SliceGroup>> of_label;
};

// Slices are along k. Cost: one pass over the voxels.
SliceGroups find_slice_groups(const LabelVolume& volume);

}  // namespace sonocase::pipeline::inline segmentation_distance
