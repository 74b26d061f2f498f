// SPDX-License-Identifier: Apache-2.0

// needle_share() in lanes: the length over which the needle fills the slab's thickness at a point
// of the scan plane. Included once per instruction set.
#include "runtime/imaging/core/simd_math-inl.h"
//
#include <cmath>

#include "runtime/imaging/core/needle_chord.h"

#if defined(SONOCASE_NEEDLE_CHORD_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_NEEDLE_CHORD_INL_H
#undef SONOCASE_NEEDLE_CHORD_INL_H
#else
#define SONOCASE_NEEDLE_CHORD_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

template <class D>
struct NeedleChord {
    hn::Mask<D> hit;
    hn::Vec<D> length_mm;    // across the plane, inside slab and needle; counts where hit
    hn::Vec<D> from_tip_mm;  // back along the shaft, >= 0
};

// wx, wz: the points relative to the tip, mm.
template <class D, class V>
HWY_INLINE NeedleChord<D> needle_chord(D d, const NeedleRow& n, V wx, V wz) {
    const auto zero = hn::Zero(d);
    const auto wy = hn::Set(d, n.wy);
    const auto u0 = hn::Add(hn::Add(hn::Mul(wx, hn::Set(d, n.ax)), hn::Set(d, n.wy * n.ay)),
                            hn::Mul(wz, hn::Set(d, n.az)));
    auto low = hn::Set(d, -0.5f * n.slab), high = hn::Set(d, 0.5f * n.slab);
    const auto bb = hn::Sub(wy, hn::Mul(u0, hn::Set(d, n.ay)));
    // The part of w normal to the axis first: the difference of two large squares would lose the
    // needle's radius.
    const auto px = hn::Sub(wx, hn::Mul(u0, hn::Set(d, n.ax))),
               pz = hn::Sub(wz, hn::Mul(u0, hn::Set(d, n.az)));
    const auto c = hn::Sub(hn::Add(hn::Add(hn::Mul(px, px), hn::Mul(bb, bb)), hn::Mul(pz, pz)),
                           hn::Set(d, n.radius * n.radius));
    auto hit = hn::Le(c, zero);
    if (n.a > 1e-6f) {
        const auto a = hn::Set(d, n.a);
        const auto disc = hn::Sub(hn::Mul(bb, bb), hn::Mul(a, c));
        hit = hn::Gt(disc, zero);
        const auto root = hn::Sqrt(hn::Max(disc, zero));
        low = hn::Max(low, hn::Div(hn::Sub(hn::Neg(bb), root), a));
        high = hn::Min(high, hn::Div(hn::Sub(root, bb), a));
    }
    if (std::abs(n.ay) > 1e-6f) {
        const auto y0 = hn::Div(hn::Sub(hn::Set(d, -n.length), u0), hn::Set(d, n.ay)),
                   y1 = hn::Div(hn::Neg(u0), hn::Set(d, n.ay));
        low = hn::Max(low, hn::Min(y0, y1));
        high = hn::Min(high, hn::Max(y0, y1));
    } else {
        hit = hn::And(hit, hn::And(hn::Le(u0, zero), hn::Ge(u0, hn::Set(d, -n.length))));
    }
    return {hit, hn::Max(hn::Sub(high, low), zero), hn::Max(hn::Neg(u0), zero)};
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
