// SPDX-License-Identifier: Apache-2.0

// Flow fields whose answers are known.
#pragma once

#include <algorithm>
#include <cmath>

#include "formats/flow/flow_field.h"

namespace sonocase::testing {

// Harmonics of one beat that peaks and falls back, like a leg artery's.
inline FlowWave leg_like_wave() {
    FlowWave wave;
    for (int h = 1; h <= kFlowHarmonics; ++h) {
        const double size = 1.8 / h, angle = -0.9 * h;
        wave[static_cast<std::size_t>(h - 1)] = {static_cast<float>(size * std::cos(angle)),
                                                 static_cast<float>(size * std::sin(angle))};
    }
    return wave;
}

// A straight round tube from `from` to `to`.
inline FlowField tube(Point3 from,
                      Point3 to,
                      double radius_mm,
                      double mean_ml_s,
                      float exponent = 2,
                      const FlowWave& wave = {}) {
    FlowField field;
    FlowVessel vessel;
    vessel.name = "tube";
    vessel.round = true;
    vessel.mean_ml_s = mean_ml_s;
    vessel.exponent = exponent;
    vessel.wave = wave;
    vessel.nodes = 1 + static_cast<int>(std::ceil(distance(from, to) / 3));
    for (int i = 0; i < vessel.nodes; ++i) {
        FlowNode node;
        node.centre = from + (static_cast<double>(i) / (vessel.nodes - 1)) * (to - from);
        node.direction = normalized(to - from);
        node.radius_mm.fill(static_cast<float>(radius_mm));
        field.nodes.push_back(node);
    }
    field.vessels = {vessel};
    return field;
}

// The same blood the other way: nodes and directions turned round, radii mirrored, since the
// section is then seen from behind.
inline FlowField reversed(FlowField field) {
    FlowVessel& v = field.vessels.front();
    std::reverse(field.nodes.begin(), field.nodes.end());
    for (FlowNode& node : field.nodes) node.direction = -node.direction;
    std::swap(v.from, v.to);
    return field;
}

}  // namespace sonocase::testing
