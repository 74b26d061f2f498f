// SPDX-License-Identifier: Apache-2.0

// Effects haze, equalisation, speckle_reduction, compression, post_filter and grey_map: from power
// to grey.
#include "runtime/imaging/physical/fast/row_grey.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "row_grey.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "runtime/imaging/physical/model/speckle_reduction.h"
#include "runtime/imaging/simd/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

// Haze, log compression and the post-filter's lateral half.
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
            const auto most = hn::Set(d, static_cast<float>(kMostDetail));
            const auto detail = hn::Sub(level, between(t.middle_above, t.middle_below));
            level = hn::Add(level, hn::Mul(between(t.change_above, t.change_below),
                                           hn::Min(hn::Max(detail, hn::Neg(most)), most)));
        }
        if (t.grain != nullptr)
            level = hn::Add(level, hn::Mul(noise_of(d, t.grain + i), hn::Set(d, t.grain_log2)));
        auto g = hn::Add(hn::Set(d, t.offset), hn::Mul(level, hn::Set(d, t.per_log2)));
        if (!t.logarithm) {
            const auto most = hn::Set(d, 12.0f);  // 4096 grey
            const auto knee = hn::Set(d, t.knee);
            g = hn::Add(exp2_fading(d, hn::Min(g, most)), hn::Set(d, t.floor));
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

// The post-filter's axial half, the grey map, and bytes.
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

HWY_EXPORT(make_grey_row);
HWY_EXPORT(make_shade_row);

void make_physical_grey(SimdTarget simd, const PhysicalGreyTask& task) {
    HWY_DISPATCH_TABLE(make_grey_row)[simd.index](task);
}
void make_physical_shade(SimdTarget simd, const PhysicalShadeTask& task) {
    HWY_DISPATCH_TABLE(make_shade_row)[simd.index](task);
}

}  // namespace sonocase::runtime
#endif
