// SPDX-License-Identifier: Apache-2.0

// Means over rows of cells.
#if defined(SONOCASE_CELL_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_CELL_ROWS_INL_H_
#undef SONOCASE_CELL_ROWS_INL_H_
#else
#define SONOCASE_CELL_ROWS_INL_H_
#endif

#include <algorithm>
#include <cstdlib>

#include <hwy/highway.h>

#include "runtime/imaging/physical/fast/cell_rows.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The mean of a row's cells and those above and below it, under a triangle of half width `along`.
HWY_INLINE void mean_along(const CellRows& cells, int row, int along, int lines, float* out) {
    const hn::ScalableTag<float> d;
    const int first = std::max(row - along, 0), last = std::min(row + along, cells.rows - 1);
    float all = 0;
    for (int r = first; r <= last; ++r) all += static_cast<float>(along + 1 - std::abs(r - row));
    const auto share = hn::Set(d, 1 / all);
    for (int l = 0; l < lines; l += static_cast<int>(hn::Lanes(d))) {
        auto sum = hn::Zero(d);
        const float* from = cells.row(first) + l;
        for (int r = first; r <= last; ++r, from += cells.stride) {
            const auto weight = hn::Set(d, static_cast<float>(along + 1 - std::abs(r - row)));
            sum = hn::Add(sum, hn::Mul(hn::LoadU(d, from), weight));
        }
        hn::StoreU(hn::Mul(sum, share), d, out + l);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
