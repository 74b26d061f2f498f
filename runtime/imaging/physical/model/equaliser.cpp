// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/equaliser.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {
namespace {

constexpr int kMostReach = 8;

// Half width of a triangle of this variance, whose own is n (n + 2) / 6.
int reach_of(double variance) {
    return std::clamp(static_cast<int>(std::lround(std::sqrt(1 + 6 * std::max(variance, 0.0)) - 1)),
                      1, kMostReach);
}

}  // namespace

int even_reach_along(const ScanGeometry& g) {
    const double cells = kEvenAlongMm / (g.step_mm * kHazeCell);
    return reach_of(cells * cells);
}

int even_reach_across(const ScanGeometry& g) {
    // Means over cells, and straight lines between them, have a variance of their own.
    const double beams = kEvenAcross * g.scanlines;
    return reach_of(beams * beams / (kHazeCell * kHazeCell) - 0.25);
}

double even_share(const ScanGeometry& g, const Tables& tables, int cell_row) {
    const double r = (cell_row + 0.5) * kHazeCell * g.step_mm;
    const MachineEqualisation& machine = tables.machine.equalisation;
    return machine.amount * std::clamp((r - machine.from_mm) / kEvenRampMm, 0.0, 1.0);
}

}  // namespace sonocase::runtime::physical
