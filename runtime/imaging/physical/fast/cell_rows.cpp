// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/fast/cell_rows.h"

#include <algorithm>
#include <cstdlib>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cell_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/core/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using namespace physical;

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

// Filter 1 2 1 across the beams; `row` has one more place before and behind them.
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

// Gain of the beams between the middles of two cells of beams, whose means are `before` and
// `after`. narrow: means of the beams themselves; out: their gains.
template <class D>
HWY_INLINE void gain_between(
    D d, float before, float after, float share, const float* narrow, float* out) {
    const auto one = hn::Set(d, 1.0f), nothing = hn::Set(d, kEvenNothing * kHazeCell);
    const auto high = hn::Set(d, static_cast<float>(kMaxEven - 1)),
               low = hn::Set(d, static_cast<float>(1 / kMaxEven - 1)),
               speckle = hn::Set(d, static_cast<float>(kEvenSpeckle));
    for (int l = 0; l < kHazeCell; l += static_cast<int>(hn::Lanes(d))) {
        const auto mix = hn::Mul(hn::Add(hn::Iota(d, static_cast<float>(l)), hn::Set(d, 0.5f)),
                                 hn::Set(d, 1.0f / kHazeCell));
        const auto around = hn::Add(hn::Set(d, before), hn::Mul(mix, hn::Set(d, after - before)));
        const auto ratio =
            hn::Div(hn::Add(around, nothing), hn::Add(hn::LoadU(d, narrow + l), nothing));
        const auto differs = hn::Sub(ratio, one);  // even_gain()
        const auto left = hn::Sub(differs, hn::Min(hn::Max(differs, hn::Neg(speckle)), speckle));
        const auto gain = hn::Min(hn::Max(left, low), high);
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
            const float before = e.wider[std::max(c, 0)],
                        after = e.wider[std::min(c + 1, cells - 1)];
            const int from = c * kHazeCell + kHalf;
            gain_between(d, before, after, share, narrow + from, out + kRowMargin + from);
        }
    }
}

// Mean of the beams within `reach`; `row` has that many more places before and behind them.
void mean_beside(float* row, int lines, int reach, float* out) {
    const hn::ScalableTag<float> d;
    for (int j = 0; j < reach; ++j) {
        row[-1 - j] = row[std::min(j, lines - 1)];
        row[lines + j] = row[std::max(lines - 1 - j, 0)];
    }
    const auto share = hn::Set(d, 1 / (2 * static_cast<float>(reach) + 1));
    for (int l = 0; l < lines; l += static_cast<int>(hn::Lanes(d))) {
        auto sum = hn::LoadU(d, row + l);
        for (int j = 1; j <= reach; ++j)
            sum = hn::Add(sum, hn::Add(hn::LoadU(d, row + l - j), hn::LoadU(d, row + l + j)));
        hn::StoreU(hn::Mul(sum, share), d, out + l);
    }
}

// log2 of the power of a row's mean envelope. mean: sums of kHazeCell samples.
void middle_of_row(const float* mean, const float* even, int lines, float* out) {
    const hn::ScalableTag<float> d;
    const auto share = hn::Set(d, 1.0f / kHazeCell), tiny = hn::Set(d, 1e-12f),
               middle = hn::Set(d, static_cast<float>(kDetailMiddle));
    for (int l = 0; l < lines; l += static_cast<int>(hn::Lanes(d))) {
        const auto envelope = hn::Mul(hn::LoadU(d, mean + l), share);
        auto power = hn::Mul(envelope, envelope);
        if (even != nullptr) power = hn::Mul(power, hn::LoadU(d, even + l));
        hn::StoreU(hn::Add(log2_of(d, hn::Add(power, tiny)), middle), d, out + l);
    }
}

void contrast_rows(ContrastRows& c, const ContrastRows::Input& in) {
    const ScanGeometry& g = *in.geometry;
    const int lines = g.scanlines, along = detail_reach_along(g), across = detail_reach_across(g);
    float* mean = c.column.data() + kRowMargin;
    for (int row = 0; row < c.rows; ++row) {
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(row) * c.stride + kRowMargin;
        float *middle = c.middle.data() + at, *change = c.change.data() + at;
        mean_along(*in.envelope, row, along, lines, mean);
        mean_beside(mean, lines, across, middle);
        middle_of_row(middle, in.even != nullptr ? in.even->gain_row(row) : nullptr, lines, middle);
        const auto variation = static_cast<float>(detail_variation(g, *in.tables, row));
        const float* noise = c.noise.data() + in.nodes->at(row, 0);
        for (int l = 0; l < lines; ++l) {
            const float *n = noise + in.node_of[l], part = in.node_part[l];
            change[l] = contrast_change(variation * (n[0] + (n[1] - n[0]) * part));
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(even_rows);
HWY_EXPORT(contrast_rows);

void EqualiserRows::resize(int cell_rows, int row_stride) {
    rows = cell_rows;
    stride = row_stride;
    const std::size_t width = stride;
    gain.assign(rows * width, 1.0f);
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

void ContrastRows::resize(int cell_rows, int row_stride, const NodeLattice& nodes) {
    rows = cell_rows;
    stride = row_stride;
    const std::size_t width = stride;
    middle.assign(rows * width, 0.0f);
    change.assign(middle.size(), 0.0f);
    noise.assign(nodes.at(rows, 0), 0.0f);
    column.assign(width, 0.0f);
}

void ContrastRows::make(SimdTarget simd, const Input& input) {
    HWY_DISPATCH_TABLE(contrast_rows)[simd.index](*this, input);
}

}  // namespace sonocase::runtime
#endif
