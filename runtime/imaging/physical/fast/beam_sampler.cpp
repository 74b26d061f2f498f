// SPDX-License-Identifier: Apache-2.0

// The first pass of model `physical`: down a block of beams, stretch by stretch.
#include "runtime/imaging/physical/fast/beam_sampler.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "beam_sampler.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "runtime/imaging/physical/fast/beam_dome-inl.h"
#include "runtime/imaging/physical/fast/beam_light-inl.h"
#include "runtime/imaging/physical/fast/beam_place-inl.h"
#include "runtime/imaging/physical/fast/beam_press-inl.h"
#include "runtime/imaging/physical/fast/beam_region-inl.h"
#include "runtime/imaging/physical/fast/beam_scatter-inl.h"
#include "runtime/imaging/physical/fast/beam_streak-inl.h"
#include "runtime/imaging/physical/fast/beam_surface-inl.h"
#include "runtime/imaging/physical/fast/beam_target-inl.h"
#include "runtime/imaging/physical/fast/beam_wall-inl.h"

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
        BeamLight<D> light{hn::IfThenZeroElse(air, edge),
                           zero,
                           zero,
                           zero,
                           zero,
                           zero,
                           zero,
                           zero,
                           zero,
                           hn::Zero(di),
                           hn::Zero(di),
                           zero,
                           b.samples};
        for (int k = 0; k < b.samples; k += kChunkRows) {
            if (!b.keep_all && hn::AllTrue(d, hn::Lt(light.light, hn::Set(d, b.dead_light)))) {
                dark_rows(d, b, v, k, light);
                break;
            }
            c.first = k;
            c.rows = std::min(kChunkRows, b.samples - k);
            c.surfaces = c.refracts = false;
            b.press = b.press_view != nullptr && b.press_view->moves(b.first_beam, k, c.rows)
                          ? &pressed
                          : nullptr;
            if (b.press != nullptr) press_stretch(d, b, c);
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
            look_chunk(d, b, c);
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
                        sizeof(float) * static_cast<std::size_t>(lanes));
    }
}

void sample_beams(PhysicalBlock& b) {
    b.hard_scene ? sample_beams_as<true>(b) : sample_beams_as<false>(b);
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(sample_beams);

void sample_beam_block(SimdTarget simd, PhysicalBlock& block) {
    HWY_DISPATCH_TABLE(sample_beams)[simd.index](block);
}

}  // namespace sonocase::runtime
#endif
