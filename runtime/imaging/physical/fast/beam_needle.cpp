// SPDX-License-Identifier: Apache-2.0

// Effect needle of model `physical`: mirror, shadow and tail of the shaft.
#include "runtime/imaging/physical/fast/beam_needle.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "beam_needle.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "runtime/imaging/simd/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

// The needle over a sampled block: mirror, shadow and tail. See needle_share() for the chord.
void needle_physical(PhysicalBlock& b, const NeedleRow& n, int row_begin, int row_end) {
    const hn::CappedTag<float, kBeamBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const float diameter = 2 * n.radius;
    const float decay = std::exp(-b.step_mm / static_cast<float>(kNeedleTailMm));
    const float dim = static_cast<float>(kNeedleShadowLog2) * std::min(b.step_mm / diameter, 1.0f);
    for (int v = 0; v < kBeamBlock; v += lanes) {
        const auto ox = hn::LoadU(d, n.origin_x + v), oz = hn::LoadU(d, n.origin_z + v);
        const auto dx = hn::LoadU(d, n.direction_x + v), dz = hn::LoadU(d, n.direction_z + v);
        const auto cosine = hn::Add(hn::Mul(hn::Set(d, n.ax), dx), hn::Mul(hn::Set(d, n.az), dz));
        const auto sine2 = hn::Max(hn::Sub(one, hn::Mul(cosine, cosine)), zero);
        const auto sine4 = hn::Mul(sine2, sine2);
        const auto mirror = hn::Mul(hn::Mul(sine4, sine4), sine4);  // sine^12
        auto tail = zero, shade = zero;
        for (int k = row_begin; k < b.samples; ++k) {
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * b.stride + v;
            tail = hn::Mul(tail, hn::Set(d, decay));
            const auto light = hn::LoadU(d, b.light + at);
            if (k < row_end) {
                const auto r = hn::Set(d, b.r[k]);
                const auto wx = hn::Add(ox, hn::Mul(r, dx)), wz = hn::Add(oz, hn::Mul(r, dz));
                const auto wy = hn::Set(d, n.wy);
                const auto u0 =
                    hn::Add(hn::Add(hn::Mul(wx, hn::Set(d, n.ax)), hn::Set(d, n.wy * n.ay)),
                            hn::Mul(wz, hn::Set(d, n.az)));
                auto low = hn::Set(d, -0.5f * n.slab), high = hn::Set(d, 0.5f * n.slab);
                const auto bb = hn::Sub(wy, hn::Mul(u0, hn::Set(d, n.ay)));
                const auto px = hn::Sub(wx, hn::Mul(u0, hn::Set(d, n.ax))),
                           pz = hn::Sub(wz, hn::Mul(u0, hn::Set(d, n.az)));
                const auto c =
                    hn::Sub(hn::Add(hn::Add(hn::Mul(px, px), hn::Mul(bb, bb)), hn::Mul(pz, pz)),
                            hn::Set(d, n.radius * n.radius));
                auto hit = hn::Le(c, zero);
                if (n.a > 1e-6f) {
                    const auto disc = hn::Sub(hn::Mul(bb, bb), hn::Mul(hn::Set(d, n.a), c));
                    hit = hn::Gt(disc, zero);
                    const auto root = hn::Sqrt(hn::Max(disc, zero));
                    low = hn::Max(low, hn::Div(hn::Sub(hn::Neg(bb), root), hn::Set(d, n.a)));
                    high = hn::Min(high, hn::Div(hn::Sub(root, bb), hn::Set(d, n.a)));
                }
                if (std::abs(n.ay) > 1e-6f) {
                    const auto y0 = hn::Div(hn::Set(d, -n.length) - u0, hn::Set(d, n.ay)),
                               y1 = hn::Div(hn::Neg(u0), hn::Set(d, n.ay));
                    low = hn::Max(low, hn::Min(y0, y1));
                    high = hn::Min(high, hn::Max(y0, y1));
                } else {
                    hit =
                        hn::And(hit, hn::And(hn::Le(u0, zero), hn::Ge(u0, hn::Set(d, -n.length))));
                }
                const auto seen = hn::Min(
                    hn::IfThenElseZero(
                        hit, hn::Div(hn::Max(hn::Sub(high, low), zero), hn::Set(d, diameter))),
                    one);
                const auto back = hn::Max(hn::Neg(u0), zero);
                const auto glint = hn::Mul(
                    hn::Set(d, 0.25f),
                    hn::Max(hn::Sub(one,
                                    hn::Mul(back, hn::Set(d, static_cast<float>(1 / kTipGlintMm)))),
                            zero));
                const auto rough = hn::Set(d, static_cast<float>(kNeedleDiffuse));
                const auto bright =
                    hn::Add(hn::Add(rough, hn::Mul(hn::Sub(one, rough), mirror)), glint);
                const auto strength = hn::Mul(seen, hn::Set(d, static_cast<float>(kNeedleGain)));
                const auto echo = hn::LoadU(di, b.echoes + at);
                const auto mirrored =
                    hn::Mul(hn::Mul(strength, bright), hn::Set(d, b.interface_scale[k]));
                hn::StoreU(
                    pack_echo(d, hn::Add(echo_real(d, echo), mirrored), echo_imaginary(d, echo)),
                    di, b.echoes + at);
                tail = hn::Max(tail,
                               hn::Mul(hn::Mul(strength, hn::Add(rough, mirror)),
                                       hn::Mul(light, hn::Set(d, static_cast<float>(kNeedleTail) *
                                                                     b.gain[k]))));
                shade = hn::Sub(shade, hn::Mul(seen, hn::Set(d, dim)));
            }
            hn::StoreU(hn::Mul(light, exp2_fading(d, shade)), d, b.light + at);
            const auto power = hn::Mul(tail, tail);
            hn::StoreU(k >= b.tail_from ? hn::Add(hn::LoadU(d, b.tail + at), power) : power, d,
                       b.tail + at);
        }
    }
    b.tail_from = std::min(b.tail_from, row_begin);
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(needle_physical);

void draw_physical_needle(PhysicalBlock& block,
                          const NeedleRow& needle,
                          int row_begin,
                          int row_end) {
    HWY_DYNAMIC_DISPATCH(needle_physical)(block, needle, row_begin, row_end);
}

}  // namespace sonocase::runtime
#endif
