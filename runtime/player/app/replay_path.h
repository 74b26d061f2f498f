// SPDX-License-Identifier: Apache-2.0

// What a replay is shown beside: the way that the tip took so far, and the straight way from where
// the needle entered to the target.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// Once per picture.
void follow_replay(App& app);

// Points 2 mm apart from a to b, both included.
std::vector<Point3> straight_way(Point3 a, Point3 b);

}  // namespace sonocase::runtime
