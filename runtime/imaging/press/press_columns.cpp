// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_columns.h"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "press_columns.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After them: included again for each instruction set.
#include "runtime/imaging/press/press_law-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 16>;
using Each = std::array<float, kColumns>;

constexpr int kNewtonSteps = 3;

// Stretch of part j of the columns from i on, how fast it falls as the stresses grow by a factor,
// and the stretch of what drains in it.
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
    if (!s.lumen[static_cast<std::size_t>(j)]) return {part.l, part.slope, part.l};
    const auto gain = hn::Set(d, static_cast<float>(kLumenGain));
    const auto growth = hn::Set(d, static_cast<float>(kLumenGrowth));
    // Only what is pressed grows: a lumen in tension is as it is.
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
                const auto edge =
                    hn::Set(d, static_cast<float>(kFineEdge[static_cast<std::size_t>(j)]));
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
        const auto edge = hn::Set(d, static_cast<float>(kFineEdge[static_cast<std::size_t>(j)]));
        const auto height = hn::Set(d, static_cast<float>(fine_height(j)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto soft = hn::Lt(edge, hn::LoadU(d, s.bone_mm.data() + i));
            const auto part = part_stretch(d, s, e, j, i, hn::LoadU(d, out.factor.data() + i));
            hn::StoreU(hn::IfThenElse(soft, part.l, one), d, out.stretch.row(j) + i);
            if (s.lumen[static_cast<std::size_t>(j)])
                hn::StoreU(part.lumen, d, out.lumen.row(j) + i);
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
        const auto edge = hn::Set(d, static_cast<float>(kFineEdge[static_cast<std::size_t>(j)]));
        const auto height = hn::Set(d, static_cast<float>(fine_height(j)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto soft = hn::Lt(edge, hn::LoadU(d, s.bone_mm.data() + i));
            auto l = hn::LoadU(d, out.stretch.row(j) + i);
            l = hn::IfThenElse(soft, hn::Mul(l, hn::LoadU(d, scale.data() + i)), l);
            hn::StoreU(l, d, out.stretch.row(j) + i);
            if (s.lumen[static_cast<std::size_t>(j)])
                hn::StoreU(
                    hn::Mul(hn::LoadU(d, out.lumen.row(j) + i), hn::LoadU(d, scale.data() + i)), d,
                    out.lumen.row(j) + i);
            hn::StoreU(hn::Sub(hn::LoadU(d, out.pressed_mm.row(j + 1) + i), hn::Mul(l, height)), d,
                       out.pressed_mm.row(j) + i);
        });
    }
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(stretch);

void stretch_columns(SimdTarget simd,
                     const PressSamples& samples,
                     const PressFace& face,
                     const PressElastic& elastic,
                     PressColumns& out) {
    HWY_DISPATCH_TABLE(stretch)[simd.index](samples, elastic, out);
    double newtons = 0;
    for (int i = 0; i < kColumns; ++i) {
        const auto at = static_cast<std::size_t>(i);
        if (!samples.touching[at]) continue;
        const auto over_width = [&](int k) {
            return field_width_mm(face.half_height_mm, row_middle(k)) *
                   static_cast<double>(elastic.stress_kpa.row(k)[i]);
        };
        newtons += static_cast<double>(out.factor[at]) *
                   ((1 - kSkinShare) * over_width(kBelowSkinRow) + kSkinShare * over_width(0));
    }
    const double root_pi = 1.7724538509055159;
    out.force_n = std::max(0.0, 1e-3 * root_pi * column_width_mm(face) * newtons);
}

}  // namespace sonocase::runtime::press
#endif
