// SPDX-License-Identifier: Apache-2.0

// The stretches of press_law.h in lanes. Included once per instruction set.
#include <hwy/highway.h>

#include "runtime/imaging/press/press_law.h"

#if defined(SONOCASE_PRESS_LAW_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_PRESS_LAW_INL_H
#undef SONOCASE_PRESS_LAW_INL_H
#else
#define SONOCASE_PRESS_LAW_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class V>
struct StretchLanes {
    V l, slope;
};

template <class D, class V>
HWY_INLINE StretchLanes<V> tissue_stretch(D d, V s) {
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const auto pressed = hn::Min(hn::Max(s, zero), hn::Set(d, static_cast<float>(kMaxStress)));
    const auto pulled = hn::Max(hn::Min(s, zero), hn::Set(d, static_cast<float>(kMinStress)));
    const auto l = hn::Div(one, hn::Sqrt(hn::Add(one, hn::Add(pressed, pressed))));
    return {hn::Sub(l, pulled), hn::Mul(l, hn::Mul(l, l))};
}

template <class D, class V>
HWY_INLINE StretchLanes<V> lumen_stretch(D d, V s) {
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const auto pressed = hn::Min(hn::Max(s, zero), hn::Set(d, static_cast<float>(kMaxStress)));
    const auto pulled = hn::Max(hn::Min(s, zero), hn::Set(d, static_cast<float>(kMinStress)));
    const auto w = hn::Sqrt(hn::Add(one, hn::Mul(pressed, pressed)));
    const auto l = hn::Div(one, hn::Add(w, pressed));
    return {hn::Sub(l, pulled), hn::Div(l, w)};
}

template <class D, class V>
HWY_INLINE V closing(D d, V l) {
    constexpr double kSteep = kClosing / (kClosing - kClosed);
    const auto ramp = hn::Max(hn::Set(d, static_cast<float>(kMinLumen)),
                              hn::Mul(hn::Set(d, static_cast<float>(kSteep)),
                                      hn::Sub(l, hn::Set(d, static_cast<float>(kClosed)))));
    return hn::IfThenElse(hn::Ge(l, hn::Set(d, static_cast<float>(kClosing))), l, ramp);
}

// a + share * (b - a)
template <class D, class V>
HWY_INLINE V mix(D, V a, V b, V share) {
    return hn::Add(a, hn::Mul(share, hn::Sub(b, a)));
}

// Calls f(i) for the first of each group of lanes of columns.
template <class D, class F>
HWY_INLINE void for_columns(D d, F&& f) {
    for (int i = 0; i < kColumns; i += static_cast<int>(hn::Lanes(d))) f(i);
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
