// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_equaliser.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/model/equaliser.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

// N of a row's beams.
std::vector<double> narrow_of(const ReferenceInput& in, const CellPlane& sums, int row) {
    const int along = even_reach_along(in.geometry), lines = sums.lines;
    std::vector<double> narrow(static_cast<std::size_t>(lines));
    const auto of = [&](int l) { return sums.mean_along(row, l, along); };
    for (int l = 0; l < lines; ++l)
        narrow[static_cast<std::size_t>(l)] =
            0.25 * of(std::max(l - 1, 0)) + 0.5 * of(l) + 0.25 * of(std::min(l + 1, lines - 1));
    return narrow;
}

// W at the middles of cells of beams.
std::vector<double> wide_of(const ReferenceInput& in, const std::vector<double>& narrow) {
    const int across = even_reach_across(in.geometry), lines = in.geometry.scanlines;
    const int cells = (lines + kHazeCell - 1) / kHazeCell;
    std::vector<double> mean(static_cast<std::size_t>(cells), 0.0), wide = mean;
    for (int l = 0; l < lines; ++l) {
        const int c = l / kHazeCell, count = std::min(lines - c * kHazeCell, kHazeCell);
        mean[static_cast<std::size_t>(c)] += narrow[static_cast<std::size_t>(l)] / count;
    }
    for (int c = 0; c < cells; ++c) {
        double s = 0, n = 0;
        for (int j = std::max(c - across, 0); j <= std::min(c + across, cells - 1); ++j) {
            s += (across + 1 - std::abs(j - c)) * mean[static_cast<std::size_t>(j)];
            n += across + 1 - std::abs(j - c);
        }
        wide[static_cast<std::size_t>(c)] = s / n;
    }
    return wide;
}

}  // namespace

CellPlane even_gains(const ReferenceInput& in, const CellPlane& sums) {
    CellPlane gains(in, 1);
    if (!in.frame.effects.equalisation || !has_equalisation(in.tables)) return gains;
    for (int row = 0; row < gains.rows; ++row) {
        const std::vector<double> narrow = narrow_of(in, sums, row), wide = wide_of(in, narrow);
        const double last = static_cast<double>(wide.size()) - 1,
                     nothing = static_cast<double>(kEvenNothing) * kHazeCell;
        for (int l = 0; l < gains.lines; ++l) {
            const double c = std::clamp((l + 0.5) / kHazeCell - 0.5, 0.0, last);
            const auto c0 = static_cast<std::size_t>(c), c1 = std::min(c0 + 1, wide.size() - 1);
            const double mix = c - static_cast<double>(c0);
            const double ratio = ((1 - mix) * wide[c0] + mix * wide[c1] + nothing) /
                                 (narrow[static_cast<std::size_t>(l)] + nothing);
            gains.at(row, l) = 1 + even_share(in.geometry, in.tables, row) * (even_gain(ratio) - 1);
        }
    }
    return gains;
}

}  // namespace sonocase::runtime
