// SPDX-License-Identifier: Apache-2.0

// Trees of vessels grown into an organ, and those of the liver.
//
// Space colonisation: targets for leaves are scattered through the organ. Each target attracts the
// nearest node; a node grows one step towards the sum of the attractions, and a target that comes
// within reach of a node is served. Branches thus spread evenly, fork where targets diverge, and
// never cross. Radii follow Murray's law with the number of targets that a branch serves:
// r = root * (n / all)^(1/3).
//
// Sources: Runions et al., Eurographics Workshop on Natural Phenomena 2007; Murray, PNAS 12:207
// (1926).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/label_facts.h"

namespace sonocase::pipeline::inline anatomy {

struct VesselNode {
    Point3 position;
    int parent = -1;       // index of an earlier node; -1: the root
    double radius_mm = 0;  // of the piece from the parent to this node
};

struct VesselTree {
    std::string name;  // "portal", "hepatic"
    bool bright_wall = false;
    std::vector<VesselNode> nodes;  // parents before children
};

struct GrowVesselsOptions {
    double root_radius_mm = 6;
    double min_radius_mm = 0.9;  // thinner pieces are left out
    double step_mm = 2.5;        // length of a piece
    double reach_mm = 7;         // distance within which a target is served
    std::uint64_t seed = 1;
};

// root      inside the organ
// targets   inside the organ
// inside    whether a point is in the organ; all nodes are
//
// Cost: nodes times targets; a liver takes a tenth of a second.
VesselTree grow_vessels(Point3 root,
                        const std::vector<Point3>& targets,
                        const std::function<bool(Point3)>& inside,
                        const GrowVesselsOptions& options = {});

// The portal and hepatic venous trees of the liver, grown from the labelled roots. A liver below 20
// ml gets none, and a tree whose vessels the label volume already has is left out.
std::vector<VesselTree> grow_liver_vessels(const LabelVolume& labels,
                                           const std::vector<LabelFacts>& facts,
                                           std::uint64_t seed);

// Draws the trees into the echo offsets (quarter dB, # voxels), only in voxels of label `liver`.
void draw_vessels(const LabelVolume& labels,
                  int liver,
                  const std::vector<VesselTree>& trees,
                  std::vector<std::int8_t>& offsets);

}  // namespace sonocase::pipeline::inline anatomy
