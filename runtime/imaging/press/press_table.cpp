// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_table.h"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "press_table.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// This comes after Highway's: it is included again for each instruction set.
#include "runtime/imaging/press/press_law-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 16>;
using Each = std::array<float, kColumns>;

constexpr int kNewtonSteps = 3;

// Stretch of part j of the columns from i on, how fast it falls as the stresses grow by a factor,
// and the stretch of the lumen in it.
template <class V>
struct PartLanes {
    V l, slope, lumen;
};
template <class D, class V>
HWY_INLINE PartLanes<V> part_stretch(
    D d, const PressSamples& s, const PressElastic& e, int j, int i, V factor) {
    const auto strain = hn::Mul(hn::LoadU(d, e.stress_kpa.row(j / kParts) + i),
                                hn::LoadU(d, e.compliance.row(j) + i));
    const auto stress = hn::Mul(strain, factor);
    auto part = tissue_stretch(d, stress);
    part.slope = hn::Mul(part.slope, strain);
    if (!s.lumen[j]) return {part.l, part.slope, part.l};
    const auto gain = hn::Set(d, static_cast<float>(kLumenGain));
    const auto growth = hn::Set(d, static_cast<float>(kLumenGrowth));
    // Only pressed lumens get more: one in tension stays as it is.
    const auto more = hn::Mul(stress, hn::Add(gain, hn::Mul(growth, stress)));
    const auto steeper = hn::Mul(strain, hn::Add(gain, hn::Mul(hn::Add(growth, growth), stress)));
    const auto pressed = hn::Gt(stress, hn::Zero(d));
    const auto lumen = lumen_stretch(d, hn::IfThenElse(pressed, more, stress));
    const auto share = hn::LoadU(d, s.drains.row(j) + i);
    const auto closed = closing(d, lumen.l);
    return {
        mix(d, part.l, closed, share),
        mix(d, part.slope, hn::Mul(lumen.slope, hn::IfThenElse(pressed, steeper, strain)), share),
        closed};
}

// Newton's steps for the factor of each column; 1 where the face does not touch.
template <class D>
void find_factors(
    D d, const PressSamples& s, const PressElastic& e, const Each& touching, Each& factor) {
    const auto fifth = hn::Set(d, 0.2f), five = hn::Set(d, 5.0f), tiny = hn::Set(d, 1e-9f);
    factor.fill(1);
    for (int step = 0; step < kNewtonSteps; ++step)
        for_columns(d, [&](int i) HWY_ATTR {
            const auto f = hn::LoadU(d, factor.data() + i);
            auto pressed = hn::Zero(d), slope = hn::Zero(d);
            const auto bone = hn::LoadU(d, s.bone_mm.data() + i);
            for (int j = 0; j < kFineRows; ++j) {
                const auto edge = hn::Set(d, static_cast<float>(kFineEdge[j]));
                const auto height = hn::IfThenElseZero(
                    hn::Lt(edge, bone), hn::Set(d, static_cast<float>(fine_height(j))));
                const auto part = part_stretch(d, s, e, j, i, f);
                pressed = hn::Add(pressed, hn::Mul(height, hn::Sub(hn::Set(d, 1.0f), part.l)));
                slope = hn::Add(slope, hn::Mul(height, part.slope));
            }
            const auto missing = hn::Sub(hn::LoadU(d, s.pressed_mm.data() + i), pressed);
            const auto next = hn::Add(f, hn::Div(missing, hn::Max(slope, tiny)));
            const auto held = hn::Min(hn::Max(next, hn::Mul(fifth, f)), hn::Mul(five, f));
            const auto moves = hn::And(hn::Gt(hn::LoadU(d, touching.data() + i), hn::Zero(d)),
                                       hn::Gt(slope, tiny));
            hn::StoreU(hn::IfThenElse(moves, held, f), d, factor.data() + i);
        });
}

void stretch(const PressSamples& s, const PressElastic& e, PressColumns& out) {
    const Lanes d;
    const auto one = hn::Set(d, 1.0f);
    Each touching{}, length{}, scale{};
    for (std::size_t i = 0; i < kColumns; ++i) touching[i] = s.touching[i] ? 1.0f : 0.0f;
    find_factors(d, s, e, touching, out.factor);
    for (int j = 0; j < kFineRows; ++j) {
        const auto edge = hn::Set(d, static_cast<float>(kFineEdge[j]));
        const auto height = hn::Set(d, static_cast<float>(fine_height(j)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto soft = hn::Lt(edge, hn::LoadU(d, s.bone_mm.data() + i));
            const auto part = part_stretch(d, s, e, j, i, hn::LoadU(d, out.factor.data() + i));
            hn::StoreU(hn::IfThenElse(soft, part.l, one), d, out.stretch.row(j) + i);
            if (s.lumen[j]) hn::StoreU(part.lumen, d, out.lumen.row(j) + i);
            hn::StoreU(hn::Add(hn::LoadU(d, length.data() + i),
                               hn::IfThenElseZero(soft, hn::Mul(part.l, height))),
                       d, length.data() + i);
        });
    }
    for (std::size_t i = 0; i < kColumns; ++i)
        scale[i] = s.touching[i] ? (s.bone_mm[i] - s.pressed_mm[i]) / length[i] : 1.0f;
    for_columns(d, [&](int i) HWY_ATTR {
        // Bone, or the last row, stays where it is.
        hn::StoreU(hn::Sub(hn::Set(d, static_cast<float>(kFineEdge[kFineRows])),
                           hn::LoadU(d, s.pressed_mm.data() + i)),
                   d, out.pressed_mm.row(kFineRows) + i);
    });
    for (int j = kFineRows - 1; j >= 0; --j) {
        const auto edge = hn::Set(d, static_cast<float>(kFineEdge[j]));
        const auto height = hn::Set(d, static_cast<float>(fine_height(j)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto soft = hn::Lt(edge, hn::LoadU(d, s.bone_mm.data() + i));
            auto l = hn::LoadU(d, out.stretch.row(j) + i);
            l = hn::IfThenElse(soft, hn::Mul(l, hn::LoadU(d, scale.data() + i)), l);
            hn::StoreU(l, d, out.stretch.row(j) + i);
            if (s.lumen[j])
                hn::StoreU(
                    hn::Mul(hn::LoadU(d, out.lumen.row(j) + i), hn::LoadU(d, scale.data() + i)), d,
                    out.lumen.row(j) + i);
            hn::StoreU(hn::Sub(hn::LoadU(d, out.pressed_mm.row(j + 1) + i), hn::Mul(l, height)), d,
                       out.pressed_mm.row(j) + i);
        });
    }
}

constexpr float kMaxSqueezed = 0.95f;
// Parts of the rows that are equally high.
constexpr int kEvenParts = 30 * kParts;
static_assert(kFineEdge[kEvenParts] == kEvenParts * kFineEdge[1]);

// Rows of the table that are nearest to a row of the sideways shift.
inline float rows_near(int n) {
    return n == 0 || n == kBulgeRows - 1 ? kBulgeEvery / 2 + 1 : kBulgeEvery;
}

// Finds the rest depth from the face at every node, and what is squeezed there.
void invert(const PressSamples& s, const PressColumns& columns, PressTable& t) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    const auto limit = hn::Set(d, kMaxSqueezed);
    const auto even = hn::Set(d, static_cast<float>(kFineEdge[1]));
    bool lumens = false;
    for (const bool lumen : s.lumen) lumens = lumens || lumen;
    std::array<float, kFineRows + 1> edges{};
    for (std::size_t j = 0; j < edges.size(); ++j) edges[j] = static_cast<float>(kFineEdge[j]);
    t.bulge_mm.values.fill(0);
    for (int m = 0; m < kTableRows; ++m) {
        const auto r = hn::Set(d, static_cast<float>(m * kTableStepMm));
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
            // Most parts belong to the even rows, whose edges need no look-up; both ways are exact.
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
            const auto squeezed = hn::Min(hn::Max(hn::Sub(one, l), zero), limit);
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
    constexpr double kStepMm = kBulgeEvery * kTableStepMm;
    constexpr float k = static_cast<float>(kBulgeAxialMm * kBulgeAxialMm / (kStepMm * kStepMm));
    std::array<float, kBulgeRows> carry{};
    float before = 0;
    for (int m = 0; m < kBulgeRows; ++m) {
        const bool end = m == 0 || m == kBulgeRows - 1;
        const float pivot = 1 / (1 + (end ? k : 2 * k) - (m == 0 ? 0 : k * before));
        before = carry[m] = k * pivot;
        const auto p = hn::Set(d, pivot), coupling = hn::Set(d, m == 0 ? 0.0f : k);
        for_columns(d, [&](int i) HWY_ATTR {
            const auto above = hn::LoadU(d, e.row(std::max(m - 1, 0)) + i);
            const auto sum = hn::Add(hn::LoadU(d, e.row(m) + i), hn::Mul(coupling, above));
            hn::StoreU(hn::Mul(sum, p), d, e.row(m) + i);
        });
    }
    for (int m = kBulgeRows - 2; m >= 0; --m) {
        const auto c = hn::Set(d, carry[m]);
        for_columns(d, [&](int i) HWY_ATTR {
            hn::StoreU(
                hn::Add(hn::LoadU(d, e.row(m) + i), hn::Mul(c, hn::LoadU(d, e.row(m + 1) + i))), d,
                e.row(m) + i);
        });
    }
}

// Minimum of dR/dr over the table.
float min_rise(const Plane<kTableRows>& rest) {
    const Lanes d;
    auto lowest = hn::Set(d, 1e9f);
    for (int m = 0; m + 1 < kTableRows; ++m)
        for_columns(d, [&](int i) HWY_ATTR {
            lowest = hn::Min(
                lowest, hn::Sub(hn::LoadU(d, rest.row(m + 1) + i), hn::LoadU(d, rest.row(m) + i)));
        });
    std::array<float, 16> each{};
    each.fill(1e9f);
    hn::StoreU(lowest, d, each.data());
    return *std::min_element(each.begin(), each.end()) / static_cast<float>(kTableStepMm);
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(stretch);
HWY_EXPORT(invert);
HWY_EXPORT(smooth_down);
HWY_EXPORT(min_rise);

namespace {

// Marks at the nodes the last part that begins at or above them. Each part is written where it
// begins, later ones over earlier ones; invert() fills in the nodes between from those above.
void mark_parts(const PressColumns& columns, PressTable& t) {
    t.part.fill(0);
    constexpr float kInverse = static_cast<float>(1 / kTableStepMm);
    for (int j = 1; j < kFineRows; ++j) {
        const float* edge = columns.pressed_mm.row(j);
        for (int i = 0; i < kColumns; ++i) {
            // The first node at or below the edge; edges above the face belong to the first node.
            const int m = std::max(0, static_cast<int>(edge[i] * kInverse + 0.99999f));
            if (m < kTableRows) t.part[m * kStride + i] = j;
        }
    }
}

// Turns what is squeezed into the sideways shift, row by row: v_x = e' - (1 - length^2 d_xx)^-1 e',
// summed from the left. Both ends stay where they are.
void sum_sideways(const PressFace& face, Plane<kBulgeRows>& e) {
    const double width = column_width_mm(face);
    const double k = kBulgeLateralMm * kBulgeLateralMm / (width * width);
    std::array<double, kColumns> pivot{}, carry{};
    for (std::size_t i = 0; i < kColumns; ++i) {
        const bool end = i == 0 || i == kColumns - 1;
        pivot[i] = 1 / (1 + (end ? k : 2 * k) - (i == 0 ? 0 : k * carry[i - 1]));
        carry[i] = k * pivot[i];
    }
    // Several rows at a time: each is one long chain of additions, and a processor can overlap
    // them.
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

// Minimum of dx/dX.
float min_spread(const PressFace& face, const Plane<kBulgeRows>& bulge) {
    float steepest = 0;
    for (int n = 0; n < kBulgeRows; ++n)
        for (int i = 0; i + 1 < kColumns; ++i)
            steepest = std::max(steepest, bulge.row(n)[i + 1] - bulge.row(n)[i]);
    return 1 - steepest / static_cast<float>(column_width_mm(face));
}

// A column's part of the force, over its width and sqrt(pi), by press_law.h.
double column_force(const PressFace& face, const Plane<kRows>& stress_kpa, int i, int fixed_row) {
    double sum = 0;
    int rows = 0;
    const auto add = [&](int k) {
        const double t = row_middle(k), fan = face.radius_mm > 0 ? 1 + t / face.radius_mm : 1;
        sum += (1 + kHandedOnPerMm * t) * field_width_mm(face.half_height_mm, t) * fan *
               static_cast<double>(stress_kpa.row(k)[i]);
        ++rows;
    };
    for (int k = 0; k < fixed_row; ++k) {
        if (row_middle(k) > kForceFromMm && row_middle(k) < kForceToMm) add(k);
    }
    if (rows == 0 && fixed_row > 0) add(fixed_row - 1);
    return rows > 0 ? sum / rows : 0;
}

}  // namespace

void stretch_columns(SimdTarget simd,
                     const PressSamples& samples,
                     const PressFace& face,
                     const PressElastic& elastic,
                     PressColumns& out) {
    HWY_DISPATCH_TABLE(stretch)[simd.index](samples, elastic, out);
    double millinewtons = 0;
    for (int i = 0; i < kColumns; ++i)
        millinewtons += column_force(face, elastic.stress_kpa, i, samples.fixed_row[i]);
    const double root_pi = 1.7724538509055159;
    out.force_n = std::max(0.0, 1e-3 * root_pi * column_width_mm(face) * millinewtons);
}

void build_table(SimdTarget simd,
                 const PressSamples& samples,
                 const PressFace& face,
                 const PressColumns& columns,
                 PressTable& out) {
    mark_parts(columns, out);
    HWY_DISPATCH_TABLE(invert)[simd.index](samples, columns, out);
    HWY_DISPATCH_TABLE(smooth_down)[simd.index](out.bulge_mm);
    sum_sideways(face, out.bulge_mm);
    const float rise = HWY_DISPATCH_TABLE(min_rise)[simd.index](out.rest_mm);
    out.min_determinant = rise * min_spread(face, out.bulge_mm);
}

}  // namespace sonocase::runtime::press
#endif
