// SPDX-License-Identifier: Apache-2.0

// Effect wall: sheets between the skin and the organs, from distances at the nodes of a lattice
// along the beams. The sum that is evaluated stands in model/wall_sheets.h.
#include "runtime/imaging/physical/fast/beam_surface-inl.h"
//
#include "runtime/imaging/physical/model/wall_sheets.h"

#if defined(SONOCASE_BEAM_WALL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_WALL_INL_H
#undef SONOCASE_BEAM_WALL_INL_H
#else
#define SONOCASE_BEAM_WALL_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// A sheet's echo by its distance, times the fourth power of the cosine: the slope of the distance
// along the beam.
template <class D, class V>
HWY_INLINE V sheet_echo(D d, const float* table, int size, V distance, V slope) {
    using namespace physical;
    const auto step = hn::Add(
        hn::Mul(hn::Add(distance, hn::Set(d, float(kWallBeforeMm))), hn::Set(d, float(kWallSteps))),
        hn::Set(d, 0.5f));
    const auto within =
        hn::Min(hn::Max(step, hn::Zero(d)), hn::Set(d, static_cast<float>(size - 1)));
    const auto echo = hn::GatherIndex(d, table, hn::ConvertTo(hn::RebindToSigned<D>(), within));
    const auto c2 = hn::Min(hn::Mul(slope, slope), hn::Set(d, 1.0f));
    const auto c4 = hn::Mul(c2, c2);
    return hn::Mul(echo, c4);
}

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
                   above = between(wall.above, inner_slope),
                   strength = between(wall.strength, unused);
        const auto outer = sheet_echo(d, wall.outer, wall.outer_size, depth, outer_slope);
        const auto inner = sheet_echo(d, wall.inner, wall.inner_size, above, inner_slope);
        const auto share = hn::Min(
            hn::Max(
                hn::Add(half, hn::Mul(hn::Sub(above, depth), hn::Set(d, float(1 / kWallBlendMm)))),
                zero),
            one);
        const auto level = exp2_near(d, hn::Mul(strength, hn::Set(d, float(1 / kDbPerLog2))));
        const auto sum = hn::Add(hn::Mul(outer, share), hn::Mul(inner, hn::Sub(one, share)));
        const auto soft =
            hn::RebindMask(d, hn::Eq(hn::And(hn::Load(di, c.look.row(row)), hn::Set(di, 7 << 16)),
                                     hn::Set(di, static_cast<std::int32_t>(kPackedSoft) << 16)));
        const auto echo = hn::IfThenElseZero(
            soft, hn::Mul(hn::Mul(sum, level), hn::Set(d, b.interface_scale[k])));
        if (c.offsets) {
            const auto most = hn::Set(di, wall.structure);
            const auto baked = hn::Load(di, c.structure.row(row));
            const auto in_wall = hn::RebindMask(di, hn::And(hn::Gt(above, zero), soft));
            auto offset = hn::Min(baked, most);
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

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
