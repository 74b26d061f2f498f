// SPDX-License-Identifier: Apache-2.0

// Which surfaces of a label map are measured: one for each edge of a tree of its labels.
//
// A thin label between two thick ones (skin between air and fat) has no distance field worth
// smoothing: its middle lies inside every kernel. Its two faces do, as surfaces of the unions on
// either side. So the labels are hung into a tree, each below the label with which it shares its
// surface (the spanning tree of largest contact areas), and what is measured is the surface of
// each label together with all that hangs below it. With phi_e < 0 inside the union of edge e,
//     score_l(x) = sum of phi_e over the edges from the root to l
// is least for the right label whatever the tree is: every phi_e on which two labels differ has
// its sign from the side that x lies on. The tree only decides which unions are smoothed.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline {

struct LabelTree {
    static constexpr int kAbsent = -2, kRoot = -1;
    std::vector<int> parent;        // # labels; kAbsent: no voxel
    std::vector<LabelSet> members;  // # labels: the label and all below it
    // # labels: other labels touch although the tree passes through this one. All three scores tie
    // at such a surface, and it would win slivers of it: its score needs its own distance too.
    std::vector<bool> between;
    // Edges between two labels: so many millimetres their scores part in one millimetre.
    std::vector<std::uint8_t> steps;  // # labels^2
    std::uint8_t steps_between(std::size_t a, std::size_t b) const {
        return steps[a * parent.size() + b];
    }
};

// The root is the first label present: what lies outside the body. Cost: one pass over the voxels.
LabelTree nest_labels(const LabelVolume& volume);

}  // namespace sonocase::pipeline
