// SPDX-License-Identifier: Apache-2.0

// Effects point_spread, near_field, noise and persistence: what the receiver makes of a row.
#include "runtime/imaging/physical/fast/row_filter.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "row_filter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "runtime/imaging/simd/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

// Light of the aperture: every other beam of boxes of 10 and 6.
template <class D>
HWY_INLINE hn::Vec<D> smooth_light(D d, const float* light) {
    const auto at = [&](int j) HWY_ATTR { return hn::LoadU(d, light + j); };
    auto sum = hn::Mul(hn::Add(at(-6), at(6)), hn::Set(d, 1 / 15.0f));
    sum = hn::Add(sum, hn::Mul(hn::Add(at(-4), at(4)), hn::Set(d, 2 / 15.0f)));
    return hn::Add(sum, hn::Mul(hn::Add(hn::Add(at(-2), at(2)), at(0)), hn::Set(d, 3 / 15.0f)));
}

// Mean of the clutter over neighbouring beams.
template <class D>
HWY_INLINE hn::Vec<D> mean_clutter(D d, const float* row, int reach) {
    auto sum = hn::LoadU(d, row);
    for (int j = 1; j <= reach; ++j)
        sum = hn::Add(sum, hn::Add(hn::LoadU(d, row - j), hn::LoadU(d, row + j)));
    return hn::Mul(sum, hn::Set(d, 1 / (2 * static_cast<float>(reach) + 1)));
}

// Adds tails, ringing and reverberation: echoes of their own, which pass through the point spread.
template <class D, class V>
HWY_INLINE void add_clutter_noise(D d, const PhysicalRowTask& t, int i, V& re, V& im) {
    const auto half = hn::Set(d, 0.5f);
    const auto unit = hn::Set(d, t.inverse_gain / 32);
    auto power = hn::Set(d, t.near_field * t.near_field);
    if (t.tail != nullptr && t.sample >= t.tail_from[i / kBeamBlock])
        power = hn::Add(power, smooth_light(d, t.tail + i));
    if (t.clutter != nullptr) {
        power = hn::Add(power, hn::Mul(mean_clutter(d, t.clutter + i, t.clutter_reach),
                                       hn::Set(d, t.clutter_drawn)));
    }
    const auto level = hn::Mul(hn::Sqrt(hn::Mul(half, power)), unit);
    re = hn::Add(re, hn::Mul(level, noise_of(d, t.clutter_re + i)));
    im = hn::Add(im, hn::Mul(level, noise_of(d, t.clutter_im + i)));
}

// Adds electronic noise, each beam's own.
template <class D, class V>
HWY_INLINE void add_electronic_noise(D d, const PhysicalRowTask& t, int i, V& re, V& im) {
    if (t.noise_rows == 0) return;
    const auto noise_level = hn::Set(d, t.noise);
    auto n_re = hn::Zero(d), n_im = hn::Zero(d);
    for (int j = 0; j < t.noise_rows; ++j) {
        const auto w = hn::Set(d, t.noise_weight[j]);
        n_re = hn::Add(n_re, hn::Mul(w, noise_of(d, t.noise_re[j] + i)));
        n_im = hn::Add(n_im, hn::Mul(w, noise_of(d, t.noise_im[j] + i)));
    }
    re = hn::Add(re, hn::Mul(noise_level, n_re));
    im = hn::Add(im, hn::Mul(noise_level, n_im));
}

// Light of the aperture times echoes, then the point spread across beams. kFirst: of the looks; it
// leaves the light to the others, and carries the noise.
template <bool kFirst>
HWY_INLINE void filter_look(const PhysicalRowTask& t, int look) {
    const hn::CappedTag<float, kBeamBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const std::int32_t* echoes = t.echoes + look * t.look_stride;
    float* out_re = t.out_re + look * t.out_stride;
    float* out_im = t.out_im + look * t.out_stride;
    float* mre = t.work_re;
    float* mim = t.work_im;
    for (int i = 0; i < t.lines; i += lanes) {
        auto light = hn::Zero(d);
        if constexpr (kFirst) {
            light = smooth_light(d, t.light + i);
            if (t.looks > 1) hn::StoreU(light, d, t.work_light + i);
        } else {
            light = hn::LoadU(d, t.work_light + i);
        }
        const auto echo = hn::LoadU(di, echoes + i);
        auto re = hn::Mul(echo_real(d, echo), light), im = hn::Mul(echo_imaginary(d, echo), light);
        if constexpr (kFirst) add_clutter_noise(d, t, i, re, im);
        hn::StoreU(re, d, mre + i);
        hn::StoreU(im, d, mim + i);
    }
    const int reach = t.point_spread ? t.reach : 0;
    for (int j = 0; j < reach; ++j) {  // mirrored at the sector's edges
        const int left = std::min(j, t.scanlines - 1), right = std::max(t.scanlines - 1 - j, 0);
        mre[-1 - j] = mre[left];
        mim[-1 - j] = mim[left];
        mre[t.scanlines + j] = mre[right];
        mim[t.scanlines + j] = mim[right];
    }
    const auto centre = hn::Set(d, t.point_spread ? t.lateral[0] : 1.0f);
    for (int i = 0; i < t.lines; i += lanes) {
        auto re = hn::Mul(hn::LoadU(d, mre + i), centre),
             im = hn::Mul(hn::LoadU(d, mim + i), centre);
        for (int j = 1; j <= reach; ++j) {
            const auto tap = hn::Set(d, t.lateral[j]);
            re = hn::Add(
                re, hn::Mul(hn::Add(hn::LoadU(d, mre + i - j), hn::LoadU(d, mre + i + j)), tap));
            im = hn::Add(
                im, hn::Mul(hn::Add(hn::LoadU(d, mim + i - j), hn::LoadU(d, mim + i + j)), tap));
        }
        if constexpr (kFirst) add_electronic_noise(d, t, i, re, im);
        hn::StoreU(re, d, out_re + i);
        hn::StoreU(im, d, out_im + i);
    }
}

void filter_across(const PhysicalRowTask& t) {
    filter_look<true>(t, 0);
    for (int look = 1; look < t.looks; ++look) filter_look<false>(t, look);
}

// Light that remains of the light above, after neighbouring beams have shared that.
void spread_light(const PhysicalSpreadTask& t) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto own = hn::Set(d, 1 - 2 * t.share), share = hn::Set(d, t.share);
    const auto least = hn::Set(d, static_cast<float>(kLeastLight));
    for (int i = 0; i < t.lines; i += lanes) {
        const auto light = hn::LoadU(d, t.light + i), was = hn::LoadU(d, t.was + i);
        const auto beside =
            hn::Add(hn::LoadU(d, t.above + i - t.beams), hn::LoadU(d, t.above + i + t.beams));
        const auto above = hn::Add(hn::Mul(hn::LoadU(d, t.above + i), own), hn::Mul(beside, share));
        const auto lit = hn::And(hn::Gt(was, hn::Zero(d)), hn::Gt(above, least));
        hn::StoreU(light, d, t.was + i);
        hn::StoreU(hn::IfThenElseZero(lit, hn::Mul(above, hn::Div(light, was))), d, t.light + i);
    }
}

// Point spread along the beam and gain; the envelope's power, the mean of all looks.
void make_power(const PhysicalPowerTask& t) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto gain = hn::Set(d, t.gain * t.gain / static_cast<float>(t.looks));
    for (int i = 0; i < t.lines; i += lanes) {
        auto power = hn::Zero(d);
        for (int look = 0; look < t.looks; ++look) {
            const std::ptrdiff_t from = look * t.look_stride + i;
            const int centre = t.axial_count / 2;
            auto tap = hn::Set(d, t.axial[centre]);
            auto re = hn::Mul(hn::LoadU(d, t.re[centre] + from), tap),
                 im = hn::Mul(hn::LoadU(d, t.im[centre] + from), tap);
            for (int j = 1; j <= centre; ++j) {
                const int above = centre - j, below = centre + j;
                tap = hn::Set(d, t.axial[below]);
                auto sum_re = hn::Zero(d), sum_im = hn::Zero(d);
                if (t.re[above] != nullptr) {
                    sum_re = hn::LoadU(d, t.re[above] + from);
                    sum_im = hn::LoadU(d, t.im[above] + from);
                }
                if (t.re[below] != nullptr) {
                    sum_re = hn::Add(sum_re, hn::LoadU(d, t.re[below] + from));
                    sum_im = hn::Add(sum_im, hn::LoadU(d, t.im[below] + from));
                }
                re = hn::Add(re, hn::Mul(sum_re, tap));
                im = hn::Add(im, hn::Mul(sum_im, tap));
            }
            power = hn::Add(power, hn::Add(hn::Mul(re, re), hn::Mul(im, im)));
        }
        power = hn::Add(hn::Mul(power, gain), hn::Set(d, t.steady));
        if (t.clutter != nullptr) {
            power = hn::Add(power, hn::Mul(mean_clutter(d, t.clutter + i, t.clutter_reach),
                                           hn::Set(d, t.clutter_steady)));
        }
        if (t.envelope_sum != nullptr) {
            hn::StoreU(hn::Add(hn::LoadU(d, t.envelope_sum + i), hn::Sqrt(power)), d,
                       t.envelope_sum + i);
        }
        hn::StoreU(power, d, t.power + i);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(filter_across);
HWY_EXPORT(make_power);
HWY_EXPORT(spread_light);

void filter_row_across(SimdTarget simd, const PhysicalRowTask& task) {
    HWY_DISPATCH_TABLE(filter_across)[simd.index](task);
}
void make_power_row(SimdTarget simd, const PhysicalPowerTask& task) {
    HWY_DISPATCH_TABLE(make_power)[simd.index](task);
}
void spread_light_row(SimdTarget simd, const PhysicalSpreadTask& task) {
    HWY_DISPATCH_TABLE(spread_light)[simd.index](task);
}

}  // namespace sonocase::runtime
#endif
