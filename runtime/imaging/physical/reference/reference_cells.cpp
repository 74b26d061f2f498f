// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_cells.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace sonocase::runtime {

double CellPlane::between(int k, int l) const {
    const double row = std::clamp((k + 0.5) / physical::kHazeCell - 0.5, 0.0, rows - 1.0);
    const int r0 = std::min(static_cast<int>(row), std::max(rows - 2, 0)),
              r1 = std::min(r0 + 1, rows - 1);
    return at(r0, l) * (1 - (row - r0)) + at(r1, l) * (row - r0);
}

double CellPlane::mean_along(int row, int l, int along) const {
    double sum = 0, all = 0;
    for (int j = -along; j <= along; ++j) {
        if (row + j < 0 || row + j >= rows) continue;
        const double weight = along + 1 - std::abs(j);
        sum += weight * at(row + j, l);
        all += weight;
    }
    return sum / all;
}

CellPlane envelope_sums(const ReferenceInput& in, const std::vector<double>& power) {
    CellPlane sums(in);
    for (int k = 0; k < in.geometry.samples; ++k) {
        for (int l = 0; l < sums.lines; ++l)
            sums.at(k / physical::kHazeCell, l) += std::sqrt(power[in.at(k, l)]);
    }
    return sums;
}

}  // namespace sonocase::runtime
