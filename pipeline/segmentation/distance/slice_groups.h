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

#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/outlines.h"

namespace sonocase::pipeline {

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

}  // namespace sonocase::pipeline
