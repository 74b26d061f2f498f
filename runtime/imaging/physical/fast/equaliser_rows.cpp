// SPDX-License-Identifier: Apache-2.0

// Effect equalisation: gain of power that evens out the beams.
#include "runtime/imaging/physical/fast/equaliser_rows.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "equaliser_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "runtime/imaging/physical/fast/cell_rows-inl.h"
#include "runtime/imaging/simd/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

// 1 2 1 across the beams; `row` has a place before and behind them.
void mean_of_three(float* row, int lines, float* out) {
    const hn::ScalableTag<float> d;
    row[-1] = row[0];
    row[lines] = row[lines - 1];
    const auto quarter = hn::Set(d, 0.25f), half = hn::Set(d, 0.5f);
    for (int l = 0; l < lines; l += static_cast<int>(hn::Lanes(d))) {
        const auto beside = hn::Add(hn::LoadU(d, row + l - 1), hn::LoadU(d, row + l + 1));
        hn::StoreU(hn::Add(hn::Mul(beside, quarter), hn::Mul(hn::LoadU(d, row + l), half)), d,
                   out + l);
    }
}

// Means over cells of beams, then a triangle over cells.
void mean_across(const float* narrow, int lines, int cells, int across, float* wide, float* wider) {
    for (int c = 0; c < cells; ++c) {
        const int count = std::min(lines - c * kHazeCell, kHazeCell);
        float sum = 0;
        for (int l = 0; l < count; ++l) sum += narrow[c * kHazeCell + l];
        wide[c] = sum / static_cast<float>(count);
    }
    for (int c = 0; c < cells; ++c) {
        float sum = 0, all = 0;
        for (int j = std::max(c - across, 0); j <= std::min(c + across, cells - 1); ++j) {
            const auto weight = static_cast<float>(across + 1 - std::abs(j - c));
            sum += weight * wide[j];
            all += weight;
        }
        wider[c] = sum / all;
    }
}

// Gain of the beams from `from` on, as many as lie between the middles of two cells of beams, of
// which `before` and `after` are the means. narrow: the beams' own; out: theirs.
template <class D>
HWY_INLINE void gain_between(
    D d, float before, float after, float share, const float* narrow, float* out) {
    const auto one = hn::Set(d, 1.0f), nothing = hn::Set(d, kEvenNothing * kHazeCell);
    const auto most = hn::Set(d, static_cast<float>(kMostEven - 1)),
               least = hn::Set(d, static_cast<float>(1 / kMostEven - 1)),
               speckle = hn::Set(d, static_cast<float>(kEvenSpeckle));
    for (int l = 0; l < kHazeCell; l += static_cast<int>(hn::Lanes(d))) {
        const auto mix = hn::Mul(hn::Add(hn::Iota(d, static_cast<float>(l)), hn::Set(d, 0.5f)),
                                 hn::Set(d, 1.0f / kHazeCell));
        const auto around = hn::Add(hn::Set(d, before), hn::Mul(mix, hn::Set(d, after - before)));
        const auto ratio =
            hn::Div(hn::Add(around, nothing), hn::Add(hn::LoadU(d, narrow + l), nothing));
        const auto differs = hn::Sub(ratio, one);  // even_gain()
        const auto left = hn::Sub(differs, hn::Min(hn::Max(differs, hn::Neg(speckle)), speckle));
        const auto gain = hn::Min(hn::Max(left, least), most);
        hn::StoreU(hn::Add(one, hn::Mul(hn::Set(d, share), gain)), d, out + l);
    }
}

void even_rows(EqualiserRows& e,
               const CellRows& envelope,
               const ScanGeometry& g,
               const Tables& tables) {
    constexpr int kHalf = kHazeCell / 2;
    const hn::CappedTag<float, kHazeCell> d;
    const int lines = g.scanlines, cells = (lines + kHazeCell - 1) / kHazeCell;
    const int along = even_reach_along(g), across = even_reach_across(g);
    float* narrow = e.column.data() + kRowMargin;
    for (int row = 0; row < e.rows; ++row) {
        float* out = e.gain.data() + static_cast<std::ptrdiff_t>(row) * e.stride;
        const auto share = static_cast<float>(even_share(g, tables, row));
        if (!(share > 0)) {
            std::fill_n(out, e.stride, 1.0f);
            continue;
        }
        float* plain = narrow + e.stride;
        mean_along(envelope, row, along, lines, plain);
        mean_of_three(plain, lines, narrow);
        mean_across(narrow, lines, cells, across, e.wide.data(), e.wider.data());
        for (int c = -1; c < cells; ++c) {  // from the middle of one cell to the next one's
            const float before = e.wider[static_cast<std::size_t>(std::max(c, 0))],
                        after = e.wider[static_cast<std::size_t>(std::min(c + 1, cells - 1))];
            const int from = c * kHazeCell + kHalf;
            gain_between(d, before, after, share, narrow + from, out + kRowMargin + from);
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(even_rows);

void EqualiserRows::resize(int cell_rows, int row_stride) {
    rows = cell_rows;
    stride = row_stride;
    const auto width = static_cast<std::size_t>(stride);
    gain.assign(static_cast<std::size_t>(rows) * width, 1.0f);
    column.assign(2 * width, 0.0f);
    wide.assign(width, 0.0f);
    wider.assign(width, 0.0f);
}

void EqualiserRows::make_gain(SimdTarget simd,
                              const CellRows& envelope,
                              const ScanGeometry& geometry,
                              const physical::Tables& tables) {
    HWY_DISPATCH_TABLE(even_rows)[simd.index](*this, envelope, geometry, tables);
}

}  // namespace sonocase::runtime
#endif
