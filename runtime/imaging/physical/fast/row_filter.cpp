// SPDX-License-Identifier: Apache-2.0

// Effects point_spread, near_field, noise and persistence: what the receiver makes of a row.
#include "runtime/imaging/physical/fast/row_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

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

// Loops over a reach are unrolled: with one that is not known, the end of each is guessed wrongly.
template <int kMost, int kReach = 0, class Call>
HWY_INLINE void with_reach(int reach, const Call& call) {
    if constexpr (kReach < kMost) {
        if (reach != kReach) return with_reach<kMost, kReach + 1>(reach, call);
    }
    call(std::integral_constant<int, kReach>());
}

// Mean of the clutter over neighbouring beams.
template <int kReach>
HWY_NOINLINE void mean_clutter(const float* row, int lines, float* out) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto share = hn::Set(d, 1 / (2 * static_cast<float>(kReach) + 1));
    for (int i = 0; i < lines; i += lanes) {
        auto sum = hn::LoadU(d, row + i);
        for (int j = 1; j <= kReach; ++j)
            sum = hn::Add(sum, hn::Add(hn::LoadU(d, row + i - j), hn::LoadU(d, row + i + j)));
        hn::StoreU(hn::Mul(sum, share), d, out + i);
    }
}
HWY_INLINE void mean_clutter(const float* row, int lines, int reach, float* out) {
    with_reach<kMaxHazeReach>(
        reach, [&](auto n) HWY_ATTR { mean_clutter<decltype(n)::value>(row, lines, out); });
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
        power =
            hn::Add(power, hn::Mul(hn::LoadU(d, t.work_clutter + i), hn::Set(d, t.clutter_drawn)));
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

// Light of the aperture times echoes. kFirst: of the looks; it leaves the light to the others.
template <bool kFirst>
HWY_INLINE void light_look(const PhysicalRowTask& task, const std::int32_t* echoes) {
    const PhysicalRowTask t = task;  // a copy, which no store into a row can change
    const hn::CappedTag<float, kBeamBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
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
        hn::StoreU(re, d, t.work_re + i);
        hn::StoreU(im, d, t.work_im + i);
    }
}

// The point spread across beams. kFirst: it carries the noise.
template <bool kFirst, int kReach>
HWY_NOINLINE void spread_look(const PhysicalRowTask& task, float* out_re, float* out_im) {
    const PhysicalRowTask t = task;
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const float *mre = t.work_re, *mim = t.work_im;
    std::array<float, kReach + 1> taps;
    for (std::size_t j = 0; j <= kReach; ++j) taps[j] = t.lateral[j];
    const auto centre = hn::Set(d, t.point_spread ? taps[0] : 1.0f);
    for (int i = 0; i < t.lines; i += lanes) {
        auto re = hn::Mul(hn::LoadU(d, mre + i), centre),
             im = hn::Mul(hn::LoadU(d, mim + i), centre);
        for (int j = 1; j <= kReach; ++j) {
            const auto tap = hn::Set(d, taps[static_cast<std::size_t>(j)]);
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

template <bool kFirst>
HWY_INLINE void filter_look(const PhysicalRowTask& t, int look) {
    light_look<kFirst>(t, t.echoes + look * t.look_stride);
    const int reach = t.point_spread ? t.reach : 0;
    float *mre = t.work_re, *mim = t.work_im;
    for (int j = 0; j < reach; ++j) {  // mirrored at the sector's edges
        const int left = std::min(j, t.scanlines - 1), right = std::max(t.scanlines - 1 - j, 0);
        mre[-1 - j] = mre[left];
        mim[-1 - j] = mim[left];
        mre[t.scanlines + j] = mre[right];
        mim[t.scanlines + j] = mim[right];
    }
    with_reach<kMaxLateral>(reach, [&](auto n) HWY_ATTR {
        spread_look<kFirst, decltype(n)::value>(t, t.out_re + look * t.out_stride,
                                                t.out_im + look * t.out_stride);
    });
}

void filter_across(const PhysicalRowTask& t) {
    if (t.clutter != nullptr) mean_clutter(t.clutter, t.lines, t.clutter_reach, t.work_clutter);
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
template <int kReach>
HWY_NOINLINE void power_of_row(const PhysicalPowerTask& task) {
    const PhysicalPowerTask t = task;
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto gain = hn::Set(d, t.gain * t.gain / static_cast<float>(t.looks));
    std::array<const float*, 2 * kReach + 1> row_re, row_im;
    std::array<float, kReach + 1> taps;
    for (std::size_t j = 0; j < row_re.size(); ++j) {
        row_re[j] = t.re[j];
        row_im[j] = t.im[j];
    }
    for (std::size_t j = 0; j <= kReach; ++j) taps[j] = t.axial[kReach + j];
    for (int i = 0; i < t.lines; i += lanes) {
        auto power = hn::Zero(d);
        for (int look = 0; look < t.looks; ++look) {
            const std::ptrdiff_t from = look * t.look_stride + i;
            const auto at = [&](const float* row) HWY_ATTR { return hn::LoadU(d, row + from); };
            auto tap = hn::Set(d, taps[0]);
            auto re = hn::Mul(at(row_re[kReach]), tap), im = hn::Mul(at(row_im[kReach]), tap);
            for (std::size_t j = 1; j <= kReach; ++j) {
                const std::size_t above = kReach - j, below = kReach + j;
                tap = hn::Set(d, taps[j]);
                re = hn::Add(re, hn::Mul(hn::Add(at(row_re[above]), at(row_re[below])), tap));
                im = hn::Add(im, hn::Mul(hn::Add(at(row_im[above]), at(row_im[below])), tap));
            }
            power = hn::Add(power, hn::Add(hn::Mul(re, re), hn::Mul(im, im)));
        }
        power = hn::Add(hn::Mul(power, gain), hn::Set(d, t.steady));
        if (t.clutter != nullptr) {
            power = hn::Add(
                power, hn::Mul(hn::LoadU(d, t.work_clutter + i), hn::Set(d, t.clutter_steady)));
        }
        if (t.envelope_sum != nullptr) {
            hn::StoreU(hn::Add(hn::LoadU(d, t.envelope_sum + i), hn::Sqrt(power)), d,
                       t.envelope_sum + i);
        }
        hn::StoreU(power, d, t.power + i);
    }
}

void make_power(const PhysicalPowerTask& t) {
    if (t.clutter != nullptr) mean_clutter(t.clutter, t.lines, t.clutter_reach, t.work_clutter);
    with_reach<kMaxAxial>(t.axial_count / 2,
                          [&](auto n) HWY_ATTR { power_of_row<decltype(n)::value>(t); });
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
