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

constexpr float kMostSqueezed = 0.95f;
// Parts of the rows that are all equally high.
constexpr int kEvenParts = 30 * kParts;
static_assert(kFineEdge[kEvenParts] == kEvenParts * kFineEdge[1]);

// Rows of the table that are nearest to a row of the sideways shift.
inline float rows_near(int n) {
    return n == 0 || n == kBulgeRows - 1 ? kBulgeEvery / 2 + 1 : kBulgeEvery;
}

// Rest depth from the face at every node, and what is squeezed there.
void invert(const PressSamples& s, const PressColumns& columns, PressTable& t) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    const auto most = hn::Set(d, kMostSqueezed);
    const auto even = hn::Set(d, static_cast<float>(kFineEdge[1]));
    bool lumens = false;
    for (const bool lumen : s.lumen) lumens = lumens || lumen;
    std::array<float, kFineRows + 1> edges{};
    for (std::size_t j = 0; j < edges.size(); ++j) edges[j] = static_cast<float>(kFineEdge[j]);
    t.bulge_mm.values.fill(0);
    for (int m = 0; m < kTableRows; ++m) {
        const auto r = hn::Set(d, static_cast<float>(m * kTableStep_mm));
        const int near = (m + kBulgeEvery / 2) / kBulgeEvery;
        const auto weight = hn::Set(d, 1 / rows_near(near));
        std::int32_t* parts = t.part.data() + m * kStride;
        for_columns(d, [&](int i) HWY_ATTR {
            auto part = hn::LoadU(di, parts + i);
            if (m > 0) part = hn::Max(part, hn::LoadU(di, parts - kStride + i));
            hn::StoreU(part, di, parts + i);
            const auto place = hn::Add(hn::Mul(part, hn::Set(di, kStride)), hn::Iota(di, i));
            const auto above = hn::GatherIndex(d, columns.pressed_mm.row(0), place);
            const auto below = hn::GatherIndex(d, columns.pressed_mm.row(1), place);
            const auto l = hn::GatherIndex(d, columns.stretch.row(0), place);
            // Most parts are of the even rows, whose edges need no look-up; both ways are exact.
            auto edge = hn::Mul(hn::ConvertTo(d, part), even);
            auto next = hn::Add(edge, even);
            if (!hn::AllTrue(di, hn::Lt(part, hn::Set(di, kEvenParts)))) {
                edge = hn::GatherIndex(d, edges.data(), part);
                next = hn::GatherIndex(d, edges.data() + 1, part);
            }
            const auto within = hn::Sub(r, above), past = hn::Sub(r, below);
            // Above the skin and below the last row nothing is stretched.
            auto rest = hn::Add(edge, hn::Div(within, l));
            rest = hn::IfThenElse(hn::Lt(within, zero), hn::Add(edge, within), rest);
            rest = hn::IfThenElse(hn::Gt(past, zero), hn::Add(next, past), hn::Min(rest, next));
            hn::StoreU(hn::Sub(rest, hn::LoadU(d, s.pressed_mm.data() + i)), d,
                       t.rest_mm.row(m) + i);
            const auto body = hn::And(hn::Ge(within, zero), hn::Le(past, zero));
            const auto squeezed = hn::Min(hn::Max(hn::Sub(one, l), zero), most);
            auto e = hn::IfThenElseZero(body, hn::Mul(squeezed, weight));
            if (lumens) e = hn::Mul(e, hn::Sub(one, hn::GatherIndex(d, s.drains.row(0), place)));
            float* bulge = t.bulge_mm.row(near) + i;
            hn::StoreU(hn::Add(hn::LoadU(d, bulge), e), d, bulge);
        });
    }
}

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

HWY_EXPORT(invert);
HWY_EXPORT(smooth_down);
HWY_EXPORT(least_rise);

namespace {

// The last part of a row that begins at or above each node. Each part is written where it begins,
// later ones over earlier ones; the nodes between take what is above them, in invert().
void mark_parts(const PressColumns& columns, PressTable& t) {
    t.part.fill(0);
    constexpr float kInverse = static_cast<float>(1 / kTableStep_mm);
    for (int j = 1; j < kFineRows; ++j) {
        const float* edge = columns.pressed_mm.row(j);
        for (int i = 0; i < kColumns; ++i) {
            // The first node at or below the edge; edges above the face belong to the first node.
            const int m = std::max(0, static_cast<int>(edge[i] * kInverse + 0.99999f));
            if (m < kTableRows) t.part[static_cast<std::size_t>(m * kStride + i)] = j;
        }
    }
}

// From what is squeezed to the sideways shift, row by row: v_x = e' - (1 - length^2 d_xx)^-1 e',
// summed from the left. Both ends stay where they are.
void sum_sideways(const PressFace& face, Plane<kBulgeRows>& e) {
    const double width = column_width_mm(face);
    const double k = kBulgeLateral_mm * kBulgeLateral_mm / (width * width);
    std::array<double, kColumns> pivot{}, carry{};
    for (std::size_t i = 0; i < kColumns; ++i) {
        const bool end = i == 0 || i == kColumns - 1;
        pivot[i] = 1 / (1 + (end ? k : 2 * k) - (i == 0 ? 0 : k * carry[i - 1]));
        carry[i] = k * pivot[i];
    }
    // Some rows at a time: each is one long chain of additions, and a processor works on several.
    constexpr int kTogether = 7;
    static_assert(kBulgeRows % kTogether == 0);
    using Numbers = std::array<double, kTogether>;
    std::array<Numbers, kColumns> mean{};
    for (int m = 0; m < kBulgeRows; m += kTogether) {
        for (std::size_t i = 0; i < kColumns; ++i)
            for (std::size_t n = 0; n < kTogether; ++n) {
                const double left = i > 0 ? k * mean[i - 1][n] : 0;
                mean[i][n] = (double{e.row(m + static_cast<int>(n))[i]} + left) * pivot[i];
            }
        for (std::size_t i = kColumns - 1; i-- > 0;)
            for (std::size_t n = 0; n < kTogether; ++n) mean[i][n] += carry[i] * mean[i + 1][n];
        Numbers sum{};
        for (std::size_t i = 0; i < kColumns; ++i)
            for (std::size_t n = 0; n < kTogether; ++n) {
                float& value = e.row(m + static_cast<int>(n))[i];
                const double half = 0.5 * (double{value} - mean[i][n]) * width;
                value = static_cast<float>(sum[n] + half);
                sum[n] += 2 * half;
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
    mark_parts(columns, out);
    HWY_DISPATCH_TABLE(invert)[simd.index](samples, columns, out);
    HWY_DISPATCH_TABLE(smooth_down)[simd.index](out.bulge_mm);
    sum_sideways(face, out.bulge_mm);
    const float rise = HWY_DISPATCH_TABLE(least_rise)[simd.index](out.rest_mm);
    out.least_determinant = rise * least_spread(face, out.bulge_mm);
}

}  // namespace sonocase::runtime::press
#endif
