// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_contrast.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/model/speckle_reduction.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

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
                std::exp2(change.between(k, l) * std::clamp(detail, -kMostDetail, kMostDetail));
        }
    }
}

}  // namespace sonocase::runtime
