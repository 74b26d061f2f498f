// SPDX-License-Identifier: Apache-2.0

// The lattice of a frame's beams on which smooth things are worked out (the faces of gas, the
// layers of the wall), linear in between: every few beams and the last one, every few samples.
#pragma once

#include <algorithm>

#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

inline constexpr int kNodeMostSamples = 32;

struct NodeSpacing {
    int beams = 4, samples = 8;
    int scanlines = 192;
    double step_mm = 0.3;

    int nodes() const { return std::max((scanlines - 2) / beams + 2, 2); }
    int line(int node) const { return std::min(node * beams, scanlines - 1); }
    double r_mm(int row) const { return (row * samples + 0.5) * step_mm; }
    // The node before a beam, and the beam's part of the way to the next.
    int node_of(int line) const { return std::min(line / beams, nodes() - 2); }
    float part(int line_number) const {
        const int node = node_of(line_number), from = line(node), to = line(node + 1);
        return to > from ? std::min(static_cast<float>(line_number - from) /
                                        static_cast<float>(to - from),
                                    1.0f)
                         : 0;
    }
};

// Few beams are far apart: then each is a node.
inline NodeSpacing node_spacing(const ScanGeometry& g, const Tables& t) {
    return {g.scanlines < 88 ? 1 : 4,
            std::clamp(static_cast<int>(t.wall.node_mm / g.step_mm), 1, kNodeMostSamples),
            g.scanlines, g.step_mm};
}

}  // namespace sonocase::runtime::physical
