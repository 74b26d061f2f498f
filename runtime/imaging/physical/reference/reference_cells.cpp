// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_cells.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "runtime/imaging/physical/model/cell_effects.h"

namespace sonocase::runtime {

using namespace physical;

double CellPlane::between(int k, int l) const {
    const double row = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, rows - 1.0);
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
            sums.at(k / kHazeCell, l) += std::sqrt(power[in.at(k, l)]);
    }
    return sums;
}

namespace {

// N (see cell_effects.h) of a row's beams.
std::vector<double> narrow_of(const ReferenceInput& in, const CellPlane& sums, int row) {
    const int along = even_reach_along(in.geometry), lines = sums.lines;
    std::vector<double> narrow(lines);
    const auto of = [&](int l) { return sums.mean_along(row, l, along); };
    for (int l = 0; l < lines; ++l)
        narrow[l] =
            0.25 * of(std::max(l - 1, 0)) + 0.5 * of(l) + 0.25 * of(std::min(l + 1, lines - 1));
    return narrow;
}

// W at the middles of cells of beams.
std::vector<double> wide_of(const ReferenceInput& in, const std::vector<double>& narrow) {
    const int across = even_reach_across(in.geometry), lines = in.geometry.scanlines;
    const int cells = (lines + kHazeCell - 1) / kHazeCell;
    std::vector<double> mean(cells, 0.0), wide = mean;
    for (int l = 0; l < lines; ++l) {
        const int c = l / kHazeCell, count = std::min(lines - c * kHazeCell, kHazeCell);
        mean[c] += narrow[l] / count;
    }
    for (int c = 0; c < cells; ++c) {
        double s = 0, n = 0;
        for (int j = std::max(c - across, 0); j <= std::min(c + across, cells - 1); ++j) {
            s += (across + 1 - std::abs(j - c)) * mean[j];
            n += across + 1 - std::abs(j - c);
        }
        wide[c] = s / n;
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
            const double ratio =
                ((1 - mix) * wide[c0] + mix * wide[c1] + nothing) / (narrow[l] + nothing);
            gains.at(row, l) = 1 + even_share(in.geometry, in.tables, row) * (even_gain(ratio) - 1);
        }
    }
    return gains;
}

namespace {

// Mean envelope of a cell and those around it.
double mean_envelope(const ReferenceInput& in, const CellPlane& sums, int row, int l) {
    const int along = detail_reach_along(in.geometry), across = detail_reach_across(in.geometry);
    double mean = 0;
    for (int j = -across; j <= across; ++j) {
        int beam = l + j;  // mirrored at the outermost beams
        if (beam < 0) beam = std::min(-1 - beam, sums.lines - 1);
        if (beam >= sums.lines) beam = std::max(2 * sums.lines - 1 - beam, 0);
        mean += sums.mean_along(row, beam, along) / (2 * across + 1);
    }
    return mean / kHazeCell;
}

}  // namespace

void reduce_speckle(const ReferenceInput& in,
                    const CellPlane& noise,
                    const CellPlane& sums,
                    const CellPlane& even,
                    std::vector<double>& power) {
    if (!in.frame.effects.speckle_reduction || !has_speckle_reduction(in.tables) ||
        in.scene.layers.empty())
        return;
    CellPlane middle(in), change(in);
    for (int row = 0; row < middle.rows; ++row) {
        const double variation = detail_variation(in.geometry, in.tables, row);
        for (int l = 0; l < middle.lines; ++l) {
            const double mean = mean_envelope(in, sums, row, l);
            middle.at(row, l) = std::log2(mean * mean * even.at(row, l) + 1e-12) + kDetailMiddle;
            change.at(row, l) = contrast_change(variation * noise.at(row, l));
        }
    }
    for (int k = 0; k < in.geometry.samples; ++k) {
        for (int l = 0; l < middle.lines; ++l) {
            double& p = power[in.at(k, l)];
            const double detail = std::log2(p + 1e-12) - middle.between(k, l);
            p = (p + 1e-12) *
                std::exp2(change.between(k, l) * std::clamp(detail, -kMaxDetail, kMaxDetail));
        }
    }
}

}  // namespace sonocase::runtime
