// SPDX-License-Identifier: Apache-2.0

// The small case with blood that flows through its vessel, for what shows flow.
#pragma once

#include "support/small_case.h"

namespace sonocase::testing {

// Along y, 20 ml/s on average and pulsatile: 18 cm/s over the section of 6 mm radius.
inline CaseBundle flowing_case() {
    CaseBundle bundle = small_case();
    FlowVessel vessel;
    vessel.name = "vessel";
    vessel.round = true;
    vessel.mean_ml_s = 20;
    vessel.nodes = 71;
    for (int i = 0; i < vessel.nodes; ++i) {
        FlowNode node;
        node.centre = {0, -70.0 + 2 * i, 25};
        node.direction = {0, 1, 0};
        node.radius_mm.fill(6);
        bundle.flow.nodes.push_back(node);
    }
    bundle.flow.vessels = {vessel};
    return bundle;
}

}  // namespace sonocase::testing
