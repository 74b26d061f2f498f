// SPDX-License-Identifier: Apache-2.0

#pragma once

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {

// Half width, at least `least`, of a triangle over cells that has this variance; one of half width
// n has n (n + 2) / 6.
inline int cell_reach(double variance, int least) {
    constexpr int kMost = 8;
    return std::clamp(static_cast<int>(std::lround(std::sqrt(1 + 6 * std::max(variance, 0.0)) - 1)),
                      least, kMost);
}

}  // namespace sonocase::runtime::physical
