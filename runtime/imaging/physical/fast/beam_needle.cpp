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
#include "runtime/imaging/needle/needle_chord-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
using namespace physical;

// The needle over a sampled block: mirror, shadow and tail.
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
                const auto chord =
                    needle_chord(d, n, hn::Add(ox, hn::Mul(r, dx)), hn::Add(oz, hn::Mul(r, dz)));
                const auto seen = hn::Min(
                    hn::IfThenElseZero(chord.hit, hn::Div(chord.length_mm, hn::Set(d, diameter))),
                    one);
                const auto glint = hn::Mul(
                    hn::Set(d, 0.25f),
                    hn::Max(hn::Sub(one, hn::Mul(chord.from_tip_mm,
                                                 hn::Set(d, static_cast<float>(1 / kTipGlintMm)))),
                            zero));
                const auto rough = hn::Set(d, static_cast<float>(kNeedleDiffuse));
                const auto bright =
                    hn::Add(hn::Add(rough, hn::Mul(hn::Sub(one, rough), mirror)), glint);
                const auto strength = hn::Mul(seen, hn::Set(d, static_cast<float>(kNeedleGain)));
                const auto mirrored =
                    hn::Mul(hn::Mul(strength, bright), hn::Set(d, b.interface_scale[k]));
                for (int look = 0; look < b.looks_at[k]; ++look) {
                    std::int32_t* echoes = b.echoes + look * b.look_stride + at;
                    const auto echo = hn::LoadU(di, echoes);
                    hn::StoreU(pack_echo(d, hn::Add(echo_real(d, echo), mirrored),
                                         echo_imaginary(d, echo)),
                               di, echoes);
                }
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

void draw_physical_needle(
    SimdTarget simd, PhysicalBlock& block, const NeedleRow& needle, int row_begin, int row_end) {
    HWY_DISPATCH_TABLE(needle_physical)[simd.index](block, needle, row_begin, row_end);
}

}  // namespace sonocase::runtime
#endif
