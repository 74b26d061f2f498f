// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/fast/row_passes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include "runtime/imaging/physical/model/cell_effects.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "row_passes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/core/simd_math-inl.h"

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

// Unrolls loops over a reach: a processor mispredicts the end of a loop whose length it cannot
// know.
template <int kMax, int kReach = 0, class Call>
HWY_INLINE void with_reach(int reach, const Call& call) {
    if constexpr (kReach < kMax) {
        if (reach != kReach) return with_reach<kMax, kReach + 1>(reach, call);
    }
    call(std::integral_constant<int, kReach>());
}

// The mean of the clutter over neighbouring beams.
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
// kSlides: a lung slides in the frame; without one nothing asks for it.
template <bool kSlides, class D, class V>
HWY_INLINE void add_clutter_noise(D d, const PhysicalRowTask& t, int i, V& re, V& im) {
    const auto half = hn::Set(d, 0.5f);
    const auto unit = hn::Set(d, t.inverse_gain / 32);
    auto power = hn::Set(d, t.near_field * t.near_field);
    if (t.tail != nullptr && t.sample >= t.tail_from[i / kBeamBlock]) {
        auto tail = smooth_light(d, t.tail + i);
        if constexpr (kSlides) {  // the grain behind a lung is its own
            const auto slides = hn::LoadU(d, t.slides + i);
            const auto level = hn::Mul(hn::Sqrt(hn::Mul(half, hn::Mul(tail, slides))), unit);
            for (int n = 0; n < 2; ++n) {
                const auto part = hn::Mul(level, hn::Set(d, t.lung_weight[n]));
                re = hn::Add(re, hn::Mul(part, noise_of(d, t.lung_re[n] + i)));
                im = hn::Add(im, hn::Mul(part, noise_of(d, t.lung_im[n] + i)));
            }
            tail = hn::Mul(tail, hn::Sub(hn::Set(d, 1.0f), slides));
        }
        power = hn::Add(power, tail);
    }
    if (t.clutter != nullptr) {
        power =
            hn::Add(power, hn::Mul(hn::LoadU(d, t.work_clutter + i), hn::Set(d, t.clutter_drawn)));
    }
    const auto level = hn::Mul(hn::Sqrt(hn::Mul(half, power)), unit);
    re = hn::Add(re, hn::Mul(level, noise_of(d, t.clutter_re + i)));
    im = hn::Add(im, hn::Mul(level, noise_of(d, t.clutter_im + i)));
}

// Adds electronic noise, which each beam has of its own.
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

// The light of the aperture times the echoes of a look. kFirst: the first look, which keeps the
// light for the others.
template <bool kFirst, bool kSlides>
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
        if constexpr (kFirst) add_clutter_noise<kSlides>(d, t, i, re, im);
        hn::StoreU(re, d, t.work_re + i);
        hn::StoreU(im, d, t.work_im + i);
    }
}

// The point spread across beams. kFirst: the first look, which carries the noise.
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
            const auto tap = hn::Set(d, taps[j]);
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
    const std::int32_t* echoes = t.echoes + look * t.look_stride;
    if (kFirst && t.slides != nullptr) {
        light_look<kFirst, true>(t, echoes);
    } else {
        light_look<kFirst, false>(t, echoes);
    }
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

// The light that remains after neighbouring beams have shared the light above.
void spread_light(const PhysicalSpreadTask& t) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto own = hn::Set(d, 1 - 2 * t.share), share = hn::Set(d, t.share);
    const auto min_light = hn::Set(d, static_cast<float>(kMinLight));
    for (int i = 0; i < t.lines; i += lanes) {
        const auto light = hn::LoadU(d, t.light + i), was = hn::LoadU(d, t.was + i);
        const auto beside =
            hn::Add(hn::LoadU(d, t.above + i - t.beams), hn::LoadU(d, t.above + i + t.beams));
        const auto above = hn::Add(hn::Mul(hn::LoadU(d, t.above + i), own), hn::Mul(beside, share));
        const auto lit = hn::And(hn::Gt(was, hn::Zero(d)), hn::Gt(above, min_light));
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

// Effects haze, equalisation, speckle_reduction and compression, and the lateral half of the
// post-filter.
void make_grey_row(const PhysicalGreyTask& t) {
    const hn::ScalableTag<float> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto low = hn::Set(d, t.low), high = hn::Set(d, static_cast<float>(kGreyCeiling));
    float* grey = t.filtered ? t.work : t.out;
    for (int i = 0; i < t.lines; i += lanes) {
        auto power = hn::LoadU(d, t.power + i);
        if (t.haze_above != nullptr) {
            const auto above = hn::LoadU(d, t.haze_above + i);
            const auto haze = hn::Add(above, hn::Mul(hn::Sub(hn::LoadU(d, t.haze_below + i), above),
                                                     hn::Set(d, t.haze_mix)));
            const auto blend = [&](const std::int8_t* const* rows) HWY_ATTR {
                return hn::Add(hn::Mul(noise_of(d, rows[0] + i), hn::Set(d, t.haze_first)),
                               hn::Mul(noise_of(d, rows[1] + i), hn::Set(d, t.haze_second)));
            };
            const auto a = blend(t.haze_re), b = blend(t.haze_im);
            const auto draw =
                hn::Mul(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Set(d, 0.5f / 1024));
            power = hn::Add(power, hn::Mul(hn::Mul(haze, haze), draw));
        }
        if (t.even_above != nullptr) {
            const auto above = hn::LoadU(d, t.even_above + i);
            power = hn::Mul(power,
                            hn::Add(above, hn::Mul(hn::Sub(hn::LoadU(d, t.even_below + i), above),
                                                   hn::Set(d, t.even_mix))));
        }
        auto level = log2_of(d, hn::Add(power, hn::Set(d, 1e-12f)));
        if (t.change_above != nullptr) {
            const auto between = [&](const float* above_row, const float* below_row) HWY_ATTR {
                const auto above = hn::LoadU(d, above_row + i);
                return hn::Add(above, hn::Mul(hn::Sub(hn::LoadU(d, below_row + i), above),
                                              hn::Set(d, t.even_mix)));
            };
            const auto limit = hn::Set(d, static_cast<float>(kMaxDetail));
            const auto detail = hn::Sub(level, between(t.middle_above, t.middle_below));
            level = hn::Add(level, hn::Mul(between(t.change_above, t.change_below),
                                           hn::Min(hn::Max(detail, hn::Neg(limit)), limit)));
        }
        if (t.grain != nullptr)
            level = hn::Add(level, hn::Mul(noise_of(d, t.grain + i), hn::Set(d, t.grain_log2)));
        auto g = hn::Add(hn::Set(d, t.offset), hn::Mul(level, hn::Set(d, t.per_log2)));
        if (!t.logarithm) {
            const auto limit = hn::Set(d, 12.0f);  // 4096 grey
            const auto knee = hn::Set(d, t.knee);
            g = hn::Add(exp2_fading(d, hn::Min(g, limit)), hn::Set(d, t.floor));
            const auto over = hn::Max(hn::Sub(g, knee), hn::Zero(d));
            g = hn::Add(hn::Min(g, knee), hn::Mul(over, hn::Set(d, t.knee_slope)));
        }
        hn::StoreU(hn::Min(hn::Max(g, low), high), d, grey + i);
    }
    if (!t.filtered) return;
    if (t.plain != nullptr) std::copy(grey, grey + t.lines, t.plain);
    grey[-1] = grey[0];
    grey[t.scanlines] = grey[t.scanlines - 1];
    for (int i = 0; i < t.lines; i += lanes) {
        const auto sides = hn::Add(hn::LoadU(d, grey + i - 1), hn::LoadU(d, grey + i + 1));
        hn::StoreU(hn::Add(hn::Mul(sides, hn::Set(d, 0.25f)),
                           hn::Mul(hn::LoadU(d, grey + i), hn::Set(d, 0.5f))),
                   d, t.out + i);
    }
}

// The axial half of the post-filter, the grey map, and bytes.
void make_shade_row(const PhysicalShadeTask& s) {
    const hn::ScalableTag<float> d;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto one = hn::Set(d, 1.0f);
    for (int i = 0; i < s.lines; i += lanes) {
        auto g = hn::LoadU(d, s.here + i);
        if (s.filtered) {
            const auto ends = hn::Add(hn::LoadU(d, s.above + i), hn::LoadU(d, s.below + i));
            g = hn::Add(hn::Mul(ends, hn::Set(d, 0.25f)), hn::Mul(g, hn::Set(d, 0.5f)));
            if (s.plain != nullptr) {
                const auto own = hn::LoadU(d, s.plain + i);
                g = hn::Add(own, hn::Mul(hn::Sub(g, own), hn::Set(d, s.filter_weight)));
            }
        }
        auto t = hn::Min(hn::Max(hn::Mul(g, hn::Set(d, 1.0f / 255)), hn::Zero(d)), one);
        if (s.grey_map) {
            const auto bend = hn::Mul(hn::Mul(t, hn::Sub(one, t)), hn::Sub(one, hn::Add(t, t)));
            t = hn::Sub(t, hn::Mul(bend, hn::Set(d, static_cast<float>(kGreyMap))));
        }
        hn::StoreU(hn::DemoteTo(d8, hn::NearestInt(hn::Mul(t, hn::Set(d, 255.0f)))), d8, s.out + i);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(filter_across);
HWY_EXPORT(make_power);
HWY_EXPORT(spread_light);
HWY_EXPORT(make_grey_row);
HWY_EXPORT(make_shade_row);

void filter_row_across(SimdTarget simd, const PhysicalRowTask& task) {
    HWY_DISPATCH_TABLE(filter_across)[simd.index](task);
}
void make_power_row(SimdTarget simd, const PhysicalPowerTask& task) {
    HWY_DISPATCH_TABLE(make_power)[simd.index](task);
}
void spread_light_row(SimdTarget simd, const PhysicalSpreadTask& task) {
    HWY_DISPATCH_TABLE(spread_light)[simd.index](task);
}
void make_physical_grey(SimdTarget simd, const PhysicalGreyTask& task) {
    HWY_DISPATCH_TABLE(make_grey_row)[simd.index](task);
}
void make_physical_shade(SimdTarget simd, const PhysicalShadeTask& task) {
    HWY_DISPATCH_TABLE(make_shade_row)[simd.index](task);
}

}  // namespace sonocase::runtime
#endif
