// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/cell_effects.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {

int even_reach_along(const ScanGeometry& g) {
    const double cells = kEvenAlongMm / (g.step_mm * kHazeCell);
    return cell_reach(cells * cells, 1);
}

int even_reach_across(const ScanGeometry& g) {
    // Means over cells, and straight lines between them, have a variance of their own.
    const double beams = kEvenAcross * g.scanlines;
    return cell_reach(beams * beams / (kHazeCell * kHazeCell) - 0.25, 1);
}

double even_share(const ScanGeometry& g, const Tables& tables, int cell_row) {
    const double r = (cell_row + 0.5) * kHazeCell * g.step_mm;
    const MachineEqualisation& machine = tables.machine.equalisation;
    return machine.amount * std::clamp((r - machine.from_mm) / kEvenRampMm, 0.0, 1.0);
}

int detail_reach_along(const ScanGeometry& g) {
    const double cells = kDetailAlongMm / (g.step_mm * kHazeCell);
    // Means over cells, and straight lines between them, have a variance of their own.
    return cell_reach(cells * cells - 0.25, 0);
}

int detail_reach_across(const ScanGeometry& g) {
    return std::clamp(static_cast<int>(std::lround(kDetailAcross * g.scanlines)), 0,
                      kMaxDetailReach);
}

double detail_variation(const ScanGeometry& g, const Tables& tables, int cell_row) {
    const double r = (cell_row + 0.5) * kHazeCell * g.step_mm;
    const MachineSpeckleReduction& machine = tables.machine.speckle_reduction;
    return machine.variation * std::clamp((r - machine.from_mm) / kDetailRampMm, 0.0, 1.0);
}

}  // namespace sonocase::runtime::physical
