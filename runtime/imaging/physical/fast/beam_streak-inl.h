// SPDX-License-Identifier: Apache-2.0

// Effect streaks: the plates that meet a block of beams; model/streak_plates.h has the sum.
#include "runtime/imaging/physical/fast/beam_surface-inl.h"
//
#include "runtime/imaging/physical/model/streak_plates.h"

#if defined(SONOCASE_BEAM_STREAK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_STREAK_INL_H
#undef SONOCASE_BEAM_STREAK_INL_H
#else
#define SONOCASE_BEAM_STREAK_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// physical::streak_ripple().
template <class D, class V>
HWY_INLINE V streak_ripple(D d, const PhysicalStreak& s, V along) {
    const auto wave = [&](auto turns) HWY_ATTR {
        const auto large = hn::Set(d, 12582912.0f);  // 3 2^22: the sum has no fraction
        return hn::Abs(hn::Sub(turns, hn::Sub(hn::Add(turns, large), large)));
    };
    const auto turns = hn::Add(hn::Mul(along, hn::Set(d, s.per_ripple)), hn::Set(d, s.phase));
    const auto second = hn::Mul(turns, hn::Set(d, static_cast<float>(physical::kSecondRipple)));
    return hn::Mul(hn::Set(d, 2 * s.ripple),
                   hn::Sub(hn::Add(wave(turns), wave(second)), hn::Set(d, 0.5f)));
}

template <class D>
HWY_INLINE void streak_row(
    D d, const PhysicalBlock& b, const PhysicalStreak& s, BeamChunk& c, int row) {
    const hn::RebindToSigned<D> di;
    const int k = c.first + row;
    const auto beam = [&](int number)
                          HWY_ATTR { return hn::LoadU(d, b.plane + number * b.lines + c.beam); };
    const auto r = hn::Set(d, b.r[k]);
    const auto x = hn::Sub(hn::Add(beam(0), hn::Mul(r, beam(2))), hn::Set(d, s.x)),
               z = hn::Sub(hn::Add(beam(1), hn::Mul(r, beam(3))), hn::Set(d, s.z));
    const auto nx = hn::Set(d, s.normal_x), nz = hn::Set(d, s.normal_z);
    const auto along = hn::Mul(hn::Sub(hn::Mul(x, nz), hn::Mul(z, nx)), hn::Set(d, s.per_length));
    const auto square = hn::Mul(along, along);
    const auto off =
        hn::Sub(hn::Mul(hn::Add(hn::Mul(x, nx), hn::Mul(z, nz)), hn::Set(d, s.per_width)),
                hn::Mul(square, hn::Set(d, s.bend)));
    auto exponent =
        hn::Mul(hn::Add(hn::Mul(off, off), hn::Mul(square, square)), hn::Set(d, -0.72134752f));
    if (s.ripple > 0) exponent = hn::Add(exponent, streak_ripple(d, s, along));
    const auto soft =
        hn::RebindMask(d, hn::Eq(hn::And(hn::Load(di, c.look.row(row)), hn::Set(di, 7 << 16)),
                                 hn::Set(di, static_cast<std::int32_t>(kPackedSoft) << 16)));
    const auto echo = hn::IfThenElseZero(
        soft, hn::Mul(exp2_fading(d, exponent), hn::Set(d, s.amplitude * b.interface_scale[k])));
    float* re = c.echo_re.row(row);
    hn::Store(hn::Add(hn::Load(d, re), echo), d, re);
}

// Plates of the block, by their first sample.
template <class D>
HWY_NOINLINE void streak_chunk(D d, const PhysicalBlock& b, BeamChunk& c) {
    for (int n = 0; n < b.streak_count; ++n) {
        const PhysicalStreak& s = b.streaks[n];
        const int begin = std::max(s.sample_begin, c.first) - c.first,
                  end = std::min(s.sample_end, c.first + c.rows) - c.first;
        if (begin < end && !c.surfaces) {
            c.surfaces = true;
            for (int r = 0; r < c.rows; ++r) clear_surface_row(d, c, r);
        }
        for (int row = begin; row < end; ++row) streak_row(d, b, s, c, row);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
