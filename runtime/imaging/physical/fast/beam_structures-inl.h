// SPDX-License-Identifier: Apache-2.0

// Structures that are drawn over the anatomy. Effect wall: sheets between the skin and the organs,
// from distances at the nodes of a lattice along the beams. Effect streaks: the plates that meet a
// block of beams. Effect diaphragm: the soft line between an organ and the lung. The formulas are
// in model/wall_sheets.h, model/streak_plates.h and model/gas_faces.h.
#include "runtime/imaging/physical/fast/beam_surface-inl.h"
#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/model/streak_plates.h"
#include "runtime/imaging/physical/model/wall_sheets.h"

#if defined(SONOCASE_BEAM_STRUCTURES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_STRUCTURES_INL_H
#undef SONOCASE_BEAM_STRUCTURES_INL_H
#else
#define SONOCASE_BEAM_STRUCTURES_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// A sheet's echo by its course (a whole number) and its distance, times the fourth power of the
// cosine: the slope of the distance along the beam.
template <class D, class V>
HWY_INLINE V
sheet_echo(D d, const float* table, int steps, float steps_per_mm, V course, V distance, V slope) {
    const auto step =
        hn::Add(hn::Mul(distance, hn::Set(d, steps_per_mm)),
                hn::Set(d, static_cast<float>(physical::kWallBeforeMm) * steps_per_mm + 0.5f));
    const hn::RebindToSigned<D> di;
    const auto within = hn::ConvertTo(
        di, hn::Min(hn::Max(step, hn::Zero(d)), hn::Set(d, static_cast<float>(steps - 1))));
    const auto echo = hn::GatherIndex(
        d, table,
        hn::Add(hn::ConvertTo(di, hn::Mul(course, hn::Set(d, static_cast<float>(steps)))), within));
    const auto c2 = hn::Min(hn::Mul(slope, slope), hn::Set(d, 1.0f));
    return hn::Mul(echo, hn::Mul(c2, c2));
}

// Draws the wall's sheets in a stretch.
template <class D>
HWY_NOINLINE void wall_chunk(D d, PhysicalBlock& b, BeamChunk& c) {
    using namespace physical;
    const hn::RebindToSigned<D> di;
    const PhysicalWall& wall = *b.wall;
    const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d), half = hn::Set(d, 0.5f);
    for (int row = 0; row < c.rows; ++row) {
        const int k = c.first + row, node = k / wall.every;
        if (k >= wall.rows) break;
        if (!wall.active[node]) continue;
        if (!c.surfaces) {
            c.surfaces = true;
            for (int r = 0; r < c.rows; ++r) clear_surface_row(d, c, r);
        }
        if (!c.offsets && wall.ground != 0) {
            c.offsets = true;
            for (int r = 0; r < c.rows; ++r) hn::Store(hn::Zero(di), di, c.structure.row(r));
        }
        b.wall_met = true;
        const auto part = hn::Set(d, static_cast<float>(k % wall.every) * wall.per_row);
        const auto between = [&](const float* plane, auto& slope) HWY_ATTR {
            const float* p = plane + node * b.lines + c.beam;
            const auto from = hn::LoadU(d, p);
            const auto step = hn::Sub(hn::LoadU(d, p + b.lines), from);
            slope = hn::Mul(step, hn::Set(d, wall.per_mm));
            return hn::Add(from, hn::Mul(step, part));
        };
        auto outer_slope = zero, inner_slope = zero, unused = zero;
        const auto depth = between(wall.depth, outer_slope),
                   above = between(wall.above, inner_slope), noise = between(wall.course, unused);
        const auto number = hn::Add(hn::Mul(noise, hn::Set(d, static_cast<float>(kCoursesPerUnit))),
                                    hn::Set(d, 0.5f * kWallCourses));
        const auto course = hn::Floor(
            hn::Min(hn::Max(number, zero), hn::Set(d, static_cast<float>(kWallCourses - 1))));
        const auto outer = sheet_echo(d, wall.outer, wall.outer_steps, wall.steps_per_mm, course,
                                      depth, outer_slope);
        const auto inner = sheet_echo(d, wall.inner, wall.inner_steps, wall.steps_per_mm, course,
                                      above, inner_slope);
        const auto share = hn::Min(
            hn::Max(
                hn::Add(half, hn::Mul(hn::Sub(above, depth), hn::Set(d, float(1 / kWallBlendMm)))),
                zero),
            one);
        const auto sum = hn::Add(hn::Mul(outer, share), hn::Mul(inner, hn::Sub(one, share)));
        const auto soft = hn::RebindMask(
            d, hn::Eq(hn::And(hn::Load(di, c.acoustics.row(row)), hn::Set(di, 7 << 16)),
                      hn::Set(di, static_cast<std::int32_t>(kPackedSoft) << 16)));
        const auto echo = hn::IfThenElseZero(soft, hn::Mul(sum, hn::Set(d, b.interface_scale[k])));
        if (c.offsets) {
            const auto max_structure = hn::Set(di, wall.max_structure);
            const auto baked = hn::Load(di, c.structure.row(row));
            const auto in_wall = hn::RebindMask(di, hn::And(hn::Gt(above, zero), soft));
            auto offset = hn::Min(baked, max_structure);
            if (wall.ground != 0) {
                const auto within = hn::Min(hn::Sub(depth, hn::Set(d, float(kWallSkinMm))), above);
                const auto risen = hn::Min(
                    hn::Max(hn::Mul(within, hn::Set(d, float(1 / kWallGroundMm))), zero), one);
                const auto ground = hn::NearestInt(hn::Mul(risen, hn::Set(d, wall.ground)));
                const auto tissue =
                    hn::Lt(hn::Load(di, c.label.row(row)), hn::Set(di, b.label_count));
                offset = hn::Add(offset, hn::IfThenElseZero(tissue, ground));
            }
            hn::Store(hn::IfThenElse(in_wall, offset, baked), di, c.structure.row(row));
        }
        float* re = c.echo_re.row(row);
        hn::Store(hn::Add(hn::Load(d, re), echo), d, re);
    }
}

// physical::streak_ripple() in lanes.
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

// Draws a plate in rows [begin, end) of the stretch. What does not depend on the row is read once.
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
        const auto soft = hn::RebindMask(
            d, hn::Eq(hn::And(hn::Load(di, c.acoustics.row(row)), kind_bits), soft_bits));
        const auto echo = hn::IfThenElseZero(
            soft, hn::Mul(exp2_fading(d, exponent), hn::Set(d, s.amplitude * scale[row])));
        float* re = c.echo_re.row(row);
        hn::Store(hn::Add(hn::Load(d, re), echo), d, re);
    }
}

// Draws the plates of the block that meet the stretch.
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

// Draws the diaphragm in a stretch.
template <class D>
HWY_NOINLINE void dome_chunk(D d, PhysicalBlock& b, BeamChunk& c) {
    using namespace physical;
    const hn::RebindToSigned<D> di;
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const auto depth = hn::LoadU(d, b.dome_mm + c.beam), cosine = hn::LoadU(d, b.cosine + c.beam);
    const auto reach = hn::Set(d, static_cast<float>(kDomeReachMm));
    const auto first = hn::Set(d, b.r[c.first]), last = hn::Set(d, b.r[c.first + c.rows - 1]);
    const auto meets =
        hn::And(hn::Gt(hn::Add(last, reach), depth), hn::Lt(hn::Sub(first, reach), depth));
    if (hn::AllFalse(d, meets)) return;
    if (!c.surfaces) {
        c.surfaces = true;
        for (int r = 0; r < c.rows; ++r) clear_surface_row(d, c, r);
    }
    if (!c.offsets) {
        c.offsets = true;
        for (int r = 0; r < c.rows; ++r) hn::Store(hn::Zero(di), di, c.structure.row(r));
    }
    b.dome_met = true;
    const auto facing =
        hn::Add(hn::Set(d, 0.4f), hn::Mul(hn::Set(d, 0.6f), hn::Mul(cosine, cosine)));
    const auto peak = hn::Mul(hn::Mul(hn::LoadU(d, b.face_peak + c.beam), facing),
                              hn::Set(d, static_cast<float>(kDomeShare)));
    const auto square_unit = [](double sigma) { return -0.72134752f / float(sigma * sigma); };
    for (int row = 0; row < c.rows; ++row) {
        const auto past = hn::Sub(hn::Set(d, b.r[c.first + row]), depth);
        const auto near = hn::Lt(hn::Abs(past), reach);
        if (hn::AllFalse(d, near)) continue;
        const auto q = hn::Mul(past, cosine);
        const auto width = hn::IfThenElse(hn::Lt(q, zero), hn::Set(d, square_unit(kDomeBeforeMm)),
                                          hn::Set(d, square_unit(kDomeBehindMm)));
        const auto line = exp2_fading(d, hn::Mul(hn::Mul(q, q), width));
        const auto tail = hn::Mul(
            exp2_fading(d, hn::Mul(hn::Abs(q), hn::Set(d, -1.44269504f / float(kDomeTailMm)))),
            hn::Set(d, static_cast<float>(kDomeTail)));
        const auto echo = hn::IfThenElseZero(near, hn::Mul(peak, hn::Add(line, tail)));
        float *re = c.echo_re.row(row), *im = c.echo_im.row(row);
        hn::Store(
            hn::IfThenElse(
                near, hn::Mul(echo, hn::Set(d, b.dome_scale * b.interface_scale[c.first + row])),
                hn::Load(d, re)),
            d, re);
        hn::Store(hn::IfThenZeroElse(near, hn::Load(d, im)), d, im);
        // The scatterers' share, in 1/16 dB.
        const auto gas = hn::Eq(hn::And(hn::Load(di, c.acoustics.row(row)), hn::Set(di, 7 << 16)),
                                hn::Set(di, static_cast<std::int32_t>(kPackedGas) << 16));
        const auto lung = hn::IfThenElseZero(hn::And(hn::RebindMask(d, gas), near),
                                             hn::Set(d, static_cast<float>(16 * kDomeGasDb)));
        const auto more = hn::Add(hn::Mul(log2_of(d, hn::Add(one, echo)),
                                          hn::Set(d, static_cast<float>(16 * kDbPerLog2))),
                                  hn::Add(lung, hn::Set(d, 0.5f)));
        std::int32_t* offset = c.structure.row(row);
        hn::Store(hn::Add(hn::Load(di, offset), hn::ConvertTo(di, more)), di, offset);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
