// SPDX-License-Identifier: Apache-2.0

// Centrelines of a piece of vessels, as a tree of lines.
//
// The tree begins at the thickest place. Again and again the voxel that is farthest from all lines,
// within the vessel, is joined to them by a path of least cost, where a step costs 1 + (6 (1 - d /
// D))^3 times its length, d being the distance to the wall and D that of the middle nearby. It ends
// where no voxel is farther than min_mm and three radii of its own vessel: what is left are
// walls, ends and spurs. Forks nearer to each other than join_mm, or than the vessel there is
// thick, are one fork: all lines go on to the first of them, so that no part of the trunk between
// them is without a line. After Bitter et al., IEEE TVCG 7:195 (2001), with a cost of our own.
#pragma once

#include <vector>

#include "formats/base/geometry.h"
#include "pipeline/flow/vessel_parts.h"

namespace sonocase::pipeline::inline flow {

struct CentreNode {        // where lines meet or end
    Point3 place;          // frame of the part's grid
    double radius_mm = 0;  // distance to the wall
    int degree = 0;        // lines; 1: a free end
    bool cut = false;      // at the border of the map, where the vessel goes on
};

struct CentreLine {
    int first = -1, last = -1;   // nodes
    std::vector<Point3> points;  // from the first to the last, voxel by voxel
    std::vector<double> radius_mm;
};

struct CentreTree {
    std::vector<CentreNode> nodes;
    std::vector<CentreLine> lines;
};

// Cost: 5 us per voxel of vessel and 1 us per voxel and line.
CentreTree centre_tree(const VesselPart& part, double min_mm = 25, double join_mm = 6);

}  // namespace sonocase::pipeline::inline flow
