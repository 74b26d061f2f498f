// SPDX-License-Identifier: Apache-2.0

// Which surfaces of a label map are measured: one per edge of a tree of its labels.
//
// A thin label between two thick ones (skin between air and fat) has no distance field worth
// smoothing: every point of it is within a kernel's reach of both faces. Its two faces can be
// smoothed as surfaces of the unions on either side. The labels are therefore arranged in a tree,
// each below a label with which it shares a surface (the spanning tree of largest contact areas),
// and what is measured is the surface of each label together with all labels below it. With
// phi_e < 0 inside the union of edge e,
//
//     score_l(x) = sum of phi_e over the edges from the root to l
//
// is smallest for the true label, whatever the tree: each phi_e that only one of two labels has in
// its sum is negative exactly on that label's side. The tree decides only which unions are
// smoothed.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline segmentation {

struct LabelTree {
    static constexpr int kAbsent = -2, kRoot = -1;
    std::vector<int> parent;        // # labels; kAbsent: no voxel
    std::vector<LabelSet> members;  // # labels: the label and all below it
    // # labels: whether other labels touch although the path between them passes through this one.
    // All three scores tie on such a surface, and this label would win slivers of it: its score
    // needs its own distance as well.
    std::vector<bool> between;
    // # labels^2: the number of edges between two labels, which is the rate at which their scores
    // separate, per mm.
    std::vector<std::uint8_t> steps;
    std::uint8_t steps_between(std::size_t a, std::size_t b) const {
        return steps[a * parent.size() + b];
    }
};

// The root is the first label present, normally the outside of the body. Cost: one pass over the
// voxels.
LabelTree nest_labels(const LabelVolume& volume);

}  // namespace sonocase::pipeline::inline segmentation
