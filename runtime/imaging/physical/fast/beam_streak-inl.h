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

// Rows begin to end of the stretch. What does not depend on the row is read once.
template <class D>
HWY_INLINE void streak_rows(
    D d, const PhysicalBlock& b, const PhysicalStreak& plate, BeamChunk& c, int begin, int end) {
    const hn::RebindToSigned<D> di;
    const PhysicalStreak s = plate;
    const auto beam = [&](int number)
                          HWY_ATTR { return hn::LoadU(d, b.plane + number * b.lines + c.beam); };
    const auto from_x = beam(0), from_z = beam(1), to_x = beam(2), to_z = beam(3);
    const auto nx = hn::Set(d, s.normal_x), nz = hn::Set(d, s.normal_z);
    const auto kind_bits = hn::Set(di, 7 << 16),
               soft_bits = hn::Set(di, static_cast<std::int32_t>(kPackedSoft) << 16);
    const float *r = b.r + c.first, *scale = b.interface_scale + c.first;
    for (int row = begin; row < end; ++row) {
        const auto depth = hn::Set(d, r[row]);
        const auto x = hn::Sub(hn::Add(from_x, hn::Mul(depth, to_x)), hn::Set(d, s.x)),
                   z = hn::Sub(hn::Add(from_z, hn::Mul(depth, to_z)), hn::Set(d, s.z));
        const auto along =
            hn::Mul(hn::Sub(hn::Mul(x, nz), hn::Mul(z, nx)), hn::Set(d, s.per_length));
        const auto square = hn::Mul(along, along);
        const auto off =
            hn::Sub(hn::Mul(hn::Add(hn::Mul(x, nx), hn::Mul(z, nz)), hn::Set(d, s.per_width)),
                    hn::Mul(square, hn::Set(d, s.bend)));
        auto exponent =
            hn::Mul(hn::Add(hn::Mul(off, off), hn::Mul(square, square)), hn::Set(d, -0.72134752f));
        if (s.ripple > 0) exponent = hn::Add(exponent, streak_ripple(d, s, along));
        const auto soft =
            hn::RebindMask(d, hn::Eq(hn::And(hn::Load(di, c.look.row(row)), kind_bits), soft_bits));
        const auto echo = hn::IfThenElseZero(
            soft, hn::Mul(exp2_fading(d, exponent), hn::Set(d, s.amplitude * scale[row])));
        float* re = c.echo_re.row(row);
        hn::Store(hn::Add(hn::Load(d, re), echo), d, re);
    }
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
        streak_rows(d, b, s, c, begin, end);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
