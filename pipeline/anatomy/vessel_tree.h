// SPDX-License-Identifier: Apache-2.0

// A tree of vessels grown into an organ.
//
// Space colonisation: leaf targets are scattered through the organ; each pulls at the nearest node,
// a node grows one step towards the sum of the pulls on it, and a target that a node comes near is
// served. Branches thus spread evenly, split where targets part, and never cross themselves. Radii
// follow Murray's law with the number of targets that a branch serves: r = root * (n / all)^(1/3).
// Source: Runions et al., Eurographics Workshop on Natural Phenomena 2007; Murray, PNAS 12:207
// (1926).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline {

struct VesselNode {
    Point3 position;
    int parent = -1;       // index of an earlier node; -1: the root
    double radius_mm = 0;  // of the piece that leads here from the parent
};

struct VesselTree {
    std::string name;  // "portal", "hepatic"
    bool bright_wall = false;
    std::vector<VesselNode>
        nodes;  // parents before children; pieces below the least radius left out
};

struct GrowVesselsOptions {
    double root_radius_mm = 6;
    double least_radius_mm = 0.9;  // thinner pieces are cut off
    double step_mm = 2.5;
    double reach_mm = 7;  // a target this near is served
    std::uint64_t seed = 1;
};

// root      inside the organ
// targets   inside the organ
// inside    whether a point lies in the organ; nodes keep to it
VesselTree grow_vessels(Point3 root,
                        const std::vector<Point3>& targets,
                        const std::function<bool(Point3)>& inside,
                        const GrowVesselsOptions& options = {});

}  // namespace sonocase::pipeline
