// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_table.h"

#include <algorithm>
#include <array>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "press_table.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After them: included again for each instruction set.
#include "runtime/imaging/press/press_law-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 16>;

// Solves (1 - length^2 d_rr) e' = e down every column, in place; no flow over the ends.
void smooth_down(Plane<kBulgeRows>& e) {
    const Lanes d;
    constexpr double kStep_mm = kBulgeEvery * kTableStep_mm;
    constexpr float k = static_cast<float>(kBulgeAxial_mm * kBulgeAxial_mm / (kStep_mm * kStep_mm));
    std::array<float, kBulgeRows> carry{};
    float before = 0;
    for (int m = 0; m < kBulgeRows; ++m) {
        const bool end = m == 0 || m == kBulgeRows - 1;
        const float pivot = 1 / (1 + (end ? k : 2 * k) - (m == 0 ? 0 : k * before));
        before = carry[static_cast<std::size_t>(m)] = k * pivot;
        const auto p = hn::Set(d, pivot), coupling = hn::Set(d, m == 0 ? 0.0f : k);
        for_columns(d, [&](int i) HWY_ATTR {
            const auto above = hn::LoadU(d, e.row(std::max(m - 1, 0)) + i);
            const auto sum = hn::Add(hn::LoadU(d, e.row(m) + i), hn::Mul(coupling, above));
            hn::StoreU(hn::Mul(sum, p), d, e.row(m) + i);
        });
    }
    for (int m = kBulgeRows - 2; m >= 0; --m) {
        const auto c = hn::Set(d, carry[static_cast<std::size_t>(m)]);
        for_columns(d, [&](int i) HWY_ATTR {
            hn::StoreU(
                hn::Add(hn::LoadU(d, e.row(m) + i), hn::Mul(c, hn::LoadU(d, e.row(m + 1) + i))), d,
                e.row(m) + i);
        });
    }
}

// Least of dR/dr over the table.
float least_rise(const Plane<kTableRows>& rest) {
    const Lanes d;
    auto least = hn::Set(d, 1e9f);
    for (int m = 0; m + 1 < kTableRows; ++m)
        for_columns(d, [&](int i) HWY_ATTR {
            least = hn::Min(
                least, hn::Sub(hn::LoadU(d, rest.row(m + 1) + i), hn::LoadU(d, rest.row(m) + i)));
        });
    std::array<float, 16> each{};
    each.fill(1e9f);
    hn::StoreU(least, d, each.data());
    return *std::min_element(each.begin(), each.end()) / static_cast<float>(kTableStep_mm);
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(smooth_down);
HWY_EXPORT(least_rise);

namespace {

// Rows of the table that are nearest to a row of the sideways shift.
constexpr float rows_near(int n) {
    return n == 0 || n == kBulgeRows - 1 ? kBulgeEvery / 2 + 1 : kBulgeEvery;
}

constexpr float kMostSqueezed = 0.95f;

// Rest depth from the face at every row of the table, and what is squeezed there.
void invert_column(const PressSamples& s, const PressColumns& columns, int i, PressTable& t) {
    const auto at = static_cast<std::size_t>(i);
    const float skin = -s.pressed_mm[at];
    int j = 0;
    float above = columns.pressed_mm.row(0)[i], below = columns.pressed_mm.row(1)[i];
    for (int m = 0; m < kTableRows; ++m) {
        const float r = static_cast<float>(m * kTableStep_mm);
        while (below <= r && j + 1 < kFineRows) {
            ++j;
            above = below;
            below = columns.pressed_mm.row(j + 1)[i];
        }
        const auto edge = static_cast<float>(kFineEdge[static_cast<std::size_t>(j)]);
        const float l = columns.stretch.row(j)[i];
        const float height = static_cast<float>(fine_height(j));
        const float inside = r - above;
        // Above the skin and below the last row nothing is stretched.
        float t_rest = edge + inside / l;
        if (inside < 0) t_rest = edge + inside;
        if (t_rest > edge + height) t_rest = edge + height + (r - below);
        t.rest_mm.row(m)[i] = t_rest + skin;
        const float squeezed =
            inside >= 0 && r < below ? std::clamp(1 - l, 0.0f, kMostSqueezed) : 0.0f;
        const int near = (m + kBulgeEvery / 2) / kBulgeEvery;
        t.bulge_mm.row(near)[i] += squeezed * (1 - s.drains.row(j)[i]) / rows_near(near);
    }
}

// From what is squeezed to the sideways shift, row by row: v_x = e' - (1 - length^2 d_xx)^-1 e',
// summed from the left. Both ends stay where they are.
void sum_sideways(const PressFace& face, Plane<kBulgeRows>& e) {
    const double width = column_width_mm(face);
    const double k = kBulgeLateral_mm * kBulgeLateral_mm / (width * width);
    std::array<double, kColumns> pivot{}, carry{}, mean{};
    for (std::size_t i = 0; i < kColumns; ++i) {
        const bool end = i == 0 || i == kColumns - 1;
        pivot[i] = 1 / (1 + (end ? k : 2 * k) - (i == 0 ? 0 : k * carry[i - 1]));
        carry[i] = k * pivot[i];
    }
    for (int m = 0; m < kBulgeRows; ++m) {
        float* row = e.row(m);
        mean[0] = double{row[0]} * pivot[0];
        for (std::size_t i = 1; i < kColumns; ++i)
            mean[i] = (double{row[i]} + k * mean[i - 1]) * pivot[i];
        for (std::size_t i = kColumns - 1; i-- > 0;) mean[i] += carry[i] * mean[i + 1];
        double sum = 0;
        for (std::size_t i = 0; i < kColumns; ++i) {
            const double half = 0.5 * (double{row[i]} - mean[i]) * width;
            row[i] = static_cast<float>(sum + half);
            sum += 2 * half;
        }
    }
}

// Least of dx/dX.
float least_spread(const PressFace& face, const Plane<kBulgeRows>& bulge) {
    float most = 0;
    for (int n = 0; n < kBulgeRows; ++n)
        for (int i = 0; i + 1 < kColumns; ++i)
            most = std::max(most, bulge.row(n)[i + 1] - bulge.row(n)[i]);
    return 1 - most / static_cast<float>(column_width_mm(face));
}

}  // namespace

void build_table(SimdTarget simd,
                 const PressSamples& samples,
                 const PressFace& face,
                 const PressColumns& columns,
                 PressTable& out) {
    out.bulge_mm.values.fill(0);
    for (int i = 0; i < kColumns; ++i) invert_column(samples, columns, i, out);
    HWY_DISPATCH_TABLE(smooth_down)[simd.index](out.bulge_mm);
    sum_sideways(face, out.bulge_mm);
    const float rise = HWY_DISPATCH_TABLE(least_rise)[simd.index](out.rest_mm);
    out.least_determinant = rise * least_spread(face, out.bulge_mm);
}

}  // namespace sonocase::runtime::press
#endif
