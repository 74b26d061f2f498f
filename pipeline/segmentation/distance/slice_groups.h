// SPDX-License-Identifier: Apache-2.0

// Which outlines of one slice go on as which outlines of the next, in a stack of thick slices.
//
// A vessel that runs obliquely through thick slices appears at another place in each, often without
// overlap: blending the slices' distance fields where they are makes a chain of discs of it.
// Outlines (8-connected components of one label in one slice) are therefore paired, and a pair that
// a shift and a turn bring together better than leaving it in place is blended along them. An
// outline that simply ends is closed by a ball: the areas of the last two slices say where its pole
// is; half-way to the next slice where they do not shrink.
#pragma once

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

    // Long enough for its direction to mean something.
    bool elongated() const;
    double direction_rad() const;  // of the long axis, in (-pi/2, pi/2]
};

struct SliceGroup {
    int lower = -1;                   // outline in slice k, or -1: it begins above k
    int upper = -1;                   // outline in slice k + 1, or -1: it ends above k
    int slice = 0;                    // k
    double shift_x = 0, shift_y = 0;  // pixels, from the lower to the upper
    double turn_rad = 0;              // about the centroid, likewise
    double end = 0.5;                 // of an outline that ends: where, in slices beyond it
};

struct SliceGroups {
    std::vector<Outline> outlines;
    std::vector<std::int32_t> outline_of_voxel;     // # voxels
    std::vector<std::vector<SliceGroup>> of_label;  // # labels; only groups that need special care
};

// Slices are along k. Cost: one pass over the voxels.
SliceGroups find_slice_groups(const LabelVolume& volume);

}  // namespace sonocase::pipeline
