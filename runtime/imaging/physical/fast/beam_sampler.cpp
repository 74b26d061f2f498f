// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/fast/beam_sampler.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "beam_sampler.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/core/needle_chord-inl.h"
#include "runtime/imaging/physical/fast/beam_light-inl.h"
#include "runtime/imaging/physical/fast/beam_place-inl.h"
#include "runtime/imaging/physical/fast/beam_region-inl.h"
#include "runtime/imaging/physical/fast/beam_scatter-inl.h"
#include "runtime/imaging/physical/fast/beam_structures-inl.h"
#include "runtime/imaging/physical/fast/beam_surface-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// kHard: the scene contains bone or gas; the other version has no code for their tails.
template <bool kHard>
void sample_beams_as(PhysicalBlock& b) {
    using D = hn::CappedTag<float, kBeamBlock>;
    const D d;
    const hn::RebindToSigned<D> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(d);
    BeamChunk c;
    press::PressChunk pressed;
    int from[kBeamBlock];
    for (int v = 0; v < kBeamBlock; v += lanes) {
        c.beam = v;
        const auto air = hn::Lt(hn::LoadU(d, b.beams + kGap * b.lines + v), zero);
        const auto edge = hn::LoadU(d, b.beams + kEdge * b.lines + v);
        BeamLight<D> light{.light = hn::IfThenZeroElse(air, edge),
                           .bone = zero,
                           .bone_slow = zero,
                           .bone_floor = zero,
                           .gas = zero,
                           .lit = zero,
                           .reverb = zero,
                           .period = zero,
                           .next = zero,
                           .loss = zero,
                           .before = hn::Zero(di),
                           .before_that = hn::Zero(di),
                           .clutter = zero,
                           .tail_from = b.samples};
        for (int k = 0; k < b.samples; k += kChunkRows) {
            if (!b.keep_all && hn::AllTrue(d, hn::Lt(light.light, hn::Set(d, b.dead_light)))) {
                dark_rows(d, b, v, k, light);
                break;
            }
            c.first = k;
            c.rows = std::min(kChunkRows, b.samples - k);
            c.surfaces = c.refracts = false;
            b.press = nullptr;
            if (b.press_view != nullptr) {
                pressed.movers = b.press_view->movers(b.first_beam, k, c.rows);
                if (pressed.movers.any()) {
                    b.press = &pressed;
                    press_stretch(d, b, c);
                }
            }
            place_chunk(d, b, c);
            entry_chunk(d, b, c);
            label_chunk(d, b, c);
            if (c.bounded) record_chunk(d, b, c);
            c.regional = b.region != nullptr && region_chunk(d, b, *b.region, c);
            if (c.bounded) surface_chunk(d, b, c);
            if (b.press != nullptr && pressed.any_closed) close_chunk(d, b, c);
            b.boundary_met = b.boundary_met || c.surfaces;
            b.refraction_met = b.refraction_met || c.refracts;
            if (b.target_count > 0 && target_chunk(d, b, c)) b.target_met = true;
            acoustics_chunk(d, b, c);
            c.offsets = b.structure;
            if (b.structure) structure_chunk(d, b, c);
            if (b.fine != nullptr && c.fine) fine_chunk(d, b, c);
            if (b.wall != nullptr && k < b.wall->rows) wall_chunk(d, b, c);
            if (b.streak_count > 0) streak_chunk(d, b, c);
            if (b.dome_mm != nullptr) dome_chunk(d, b, c);
            scatter_chunk(d, b, c);
            light_chunk<kHard>(d, b, c, light);
        }
        from[v] = light.tail_from;
    }
    b.tail_from = b.samples;
    for (int v = 0; v < kBeamBlock; v += lanes) b.tail_from = std::min(b.tail_from, from[v]);
    b.hard_met = b.tail_from < b.samples;
    for (int v = 0; v < kBeamBlock; v += lanes) {
        for (int k = b.tail_from; k < from[v]; ++k)
            std::memset(b.tail + static_cast<std::ptrdiff_t>(k) * b.stride + v, 0,
                        sizeof(float) * lanes);
    }
}

void sample_beams(PhysicalBlock& b) {
    b.hard_scene ? sample_beams_as<true>(b) : sample_beams_as<false>(b);
}

// Effect needle: the mirror, the shadow and the tail of the shaft.
void needle_physical(PhysicalBlock& b, const NeedleRow& n, int row_begin, int row_end) {
    using namespace physical;
    const hn::CappedTag<float, kBeamBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const float diameter = 2 * n.radius;
    const float per_line = b.step_mm / diameter;
    const float decay = std::exp(-b.step_mm / static_cast<float>(kNeedleTailMm));
    const float dim = static_cast<float>(kNeedleShadowLog2) * std::min(b.step_mm / diameter, 1.0f);
    for (int v = 0; v < kBeamBlock; v += lanes) {
        const auto ox = hn::LoadU(d, n.origin_x + v), oz = hn::LoadU(d, n.origin_z + v);
        const auto dx = hn::LoadU(d, n.direction_x + v), dz = hn::LoadU(d, n.direction_z + v);
        const auto cosine = hn::Add(hn::Mul(hn::Set(d, n.ax), dx), hn::Mul(hn::Set(d, n.az), dz));
        const auto cosine2 = hn::Mul(cosine, cosine);
        const auto mirror = exp2_fading(d, hn::Mul(cosine2, hn::Set(d, -n.inverse_lobe2)));
        const auto rough = hn::Set(d, n.rough);
        const auto sine = hn::Sqrt(hn::Max(hn::Sub(one, cosine2), hn::Set(d, 0.01f)));
        const auto faces = hn::Neg(hn::Div(
            hn::Add(hn::Mul(hn::Set(d, n.bevel_x), dx), hn::Mul(hn::Set(d, n.bevel_z), dz)), sine));
        const auto tip = hn::Add(
            hn::Set(d, n.tip_middle),
            hn::Mul(hn::Set(d, n.tip_swing), hn::Max(hn::Min(faces, one), hn::Set(d, -1.0f))));
        auto tail = zero, shade = zero, lines = zero;
        for (int k = row_begin; k < b.samples; ++k) {
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * b.stride + v;
            tail = hn::Mul(tail, hn::Set(d, decay));
            const auto light = hn::LoadU(d, b.light + at);
            if (k < row_end) {
                const auto r = hn::Set(d, b.r[k]);
                const auto chord =
                    needle_chord(d, n, hn::Add(ox, hn::Mul(r, dx)), hn::Add(oz, hn::Mul(r, dz)));
                auto seen = hn::Min(
                    hn::IfThenElseZero(chord.hit, hn::Div(chord.length_mm, hn::Set(d, diameter))),
                    one);
                // What is there behind the diaphragm is a mirror image of something else.
                if (b.dome_mm != nullptr)
                    seen = hn::IfThenElseZero(hn::Lt(r, hn::LoadU(d, b.dome_mm + v)), seen);
                const auto tip_part =
                    hn::Max(hn::Min(hn::Sub(hn::Set(d, 2.0f), chord.from_tip_mm), one), zero);
                const auto base = hn::Add(rough, hn::Mul(hn::Sub(tip, rough), tip_part));
                const auto bright = hn::Add(base, hn::Mul(hn::Sub(one, base), mirror));
                const auto strength =
                    hn::Mul(seen, hn::Set(d, static_cast<float>(kNeedleGain) * n.echo));
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
                                                                     n.tail * b.gain[k]))));
                shade = hn::Sub(shade, hn::Mul(seen, hn::Set(d, dim)));
                lines = hn::IfThenZeroElse(hn::Gt(seen, zero), lines);
            }
            // Sound runs to and fro between the shaft's walls: a line per diameter.
            lines = hn::Add(lines, hn::Set(d, per_line));
            const auto off = hn::Sub(hn::Add(lines, lines),
                                     hn::Add(hn::Mul(hn::Floor(lines), hn::Set(d, 2.0f)), one));
            const auto line =
                hn::Mul(tail, hn::Add(hn::Set(d, static_cast<float>(kBetweenLines)),
                                      hn::Mul(hn::Mul(off, off),
                                              hn::Set(d, static_cast<float>(1 - kBetweenLines)))));
            hn::StoreU(hn::Mul(light, exp2_fading(d, shade)), d, b.light + at);
            const auto power = hn::Mul(line, line);
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

HWY_EXPORT(sample_beams);
HWY_EXPORT(needle_physical);

void sample_beam_block(SimdTarget simd, PhysicalBlock& block) {
    HWY_DISPATCH_TABLE(sample_beams)[simd.index](block);
}

void draw_physical_needle(
    SimdTarget simd, PhysicalBlock& block, const NeedleRow& needle, int row_begin, int row_end) {
    HWY_DISPATCH_TABLE(needle_physical)[simd.index](block, needle, row_begin, row_end);
}

}  // namespace sonocase::runtime
#endif
