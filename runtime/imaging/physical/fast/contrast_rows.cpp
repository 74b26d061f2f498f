// SPDX-License-Identifier: Apache-2.0

// Effect speckle_reduction: what each cell's detail is taken from, and its contrast.
#include "runtime/imaging/physical/fast/contrast_rows.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "contrast_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "runtime/imaging/physical/fast/cell_rows-inl.h"
#include "runtime/imaging/simd/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

// Mean of the beams within `reach`; `row` has as many places before and behind them.
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

// log2 of the power of a row's mean envelope; `mean`: sums of kHazeCell samples.
void middle_of_row(const float* mean, const float* even, int lines, float* out) {
    const hn::ScalableTag<float> d;
    const auto share = hn::Set(d, 1.0f / kHazeCell), least = hn::Set(d, 1e-12f),
               middle = hn::Set(d, static_cast<float>(kDetailMiddle));
    for (int l = 0; l < lines; l += static_cast<int>(hn::Lanes(d))) {
        const auto envelope = hn::Mul(hn::LoadU(d, mean + l), share);
        auto power = hn::Mul(envelope, envelope);
        if (even != nullptr) power = hn::Mul(power, hn::LoadU(d, even + l));
        hn::StoreU(hn::Add(log2_of(d, hn::Add(power, least)), middle), d, out + l);
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

HWY_EXPORT(contrast_rows);

void ContrastRows::resize(int cell_rows, int row_stride, const NodeLattice& nodes) {
    rows = cell_rows;
    stride = row_stride;
    const auto width = static_cast<std::size_t>(stride);
    middle.assign(static_cast<std::size_t>(rows) * width, 0.0f);
    change.assign(middle.size(), 0.0f);
    noise.assign(nodes.at(rows, 0), 0.0f);
    column.assign(width, 0.0f);
}

void ContrastRows::make(SimdTarget simd, const Input& input) {
    HWY_DISPATCH_TABLE(contrast_rows)[simd.index](*this, input);
}

}  // namespace sonocase::runtime
#endif
