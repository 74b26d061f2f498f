// SPDX-License-Identifier: Apache-2.0

// Effects boundaries, pulsation, interfaces and edge_shadow: on which side of the plane in its
// voxel a sample lies, and what the surface itself reflects and takes away.
#include "runtime/imaging/physical/fast/beam_press-inl.h"
#include "runtime/imaging/simd/simd_math-inl.h"
//
#include "formats/volume/boundary_record.h"
#include "runtime/imaging/physical/fast/beam_chunk.h"

#if defined(SONOCASE_BEAM_SURFACE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_SURFACE_INL_H
#undef SONOCASE_BEAM_SURFACE_INL_H
#else
#define SONOCASE_BEAM_SURFACE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// Roughness and glint of surfaces at a row's samples; see PhysicalTextures::rough.
template <class D>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> rough_at(D d,
                                                   const PhysicalBlock& b,
                                                   const BeamChunk& c,
                                                   int row) {
    static_assert(physical::kRoughEdge == 32);
    const hn::RebindToSigned<D> di;
    const auto scale = hn::Set(d, b.rough_per_voxel);
    const auto coordinate = [&](const float* p) HWY_ATTR {
        return hn::And(rounded_bits(d, hn::Mul(hn::Load(d, p), scale)),
                       hn::Set(di, physical::kRoughEdge - 1));
    };
    const auto i = coordinate(c.x.row(row)), j = coordinate(c.y.row(row)),
               l = coordinate(c.z.row(row));
    return hn::GatherIndex(di, b.rough,
                           hn::Or(i, hn::Or(hn::ShiftLeft<5>(j), hn::ShiftLeft<10>(l))));
}

// log2 of amplitude per mm that a grazing beam loses along the wall of fluid.
template <class D, class V>
HWY_INLINE V graze_loss(D d, V cosine, V distance_mm) {
    const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    const auto graze = hn::Max(
        hn::Sub(one, hn::Mul(cosine, hn::Set(d, static_cast<float>(1 / physical::kEdgeCos)))),
        zero);
    const auto close =
        hn::Max(hn::Sub(one, hn::Mul(hn::Abs(distance_mm),
                                     hn::Set(d, static_cast<float>(1 / physical::kEdgeReachMm)))),
                zero);
    return hn::Mul(hn::Mul(hn::Mul(graze, graze), close),
                   hn::Set(d, static_cast<float>(physical::kEdgeLossLog2PerMm)));
}

template <class D>
HWY_INLINE void clear_surface_row(D d, BeamChunk& c, int row) {
    hn::Store(hn::Zero(d), d, c.echo_re.row(row));
    hn::Store(hn::Zero(d), d, c.echo_im.row(row));
    hn::Store(hn::Zero(d), d, c.edge_loss.row(row));
    hn::Store(hn::Set(d, 1.0f), d, c.facing.row(row));
}

// The records of the voxels that are looked up.
template <class D>
HWY_NOINLINE void record_chunk(D, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const auto flag = hn::Set(di, static_cast<std::int32_t>(kBoundaryFlag));
    const auto none = hn::Set(di, static_cast<std::int32_t>(kNoBoundary));
    for (int row = 0; row < c.rows; ++row) {
        const auto bounded = hn::TestBit(hn::Load(di, c.entry.row(row)), flag);
        const auto record = hn::GatherIndex(di, b.boundary, hn::Load(di, c.record.row(row)));
        hn::Store(hn::IfThenElse(bounded, record, none), di, c.record.row(row));
    }
}

template <class D>
HWY_NOINLINE void surface_chunk(D d, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const int v = c.beam;
    const auto dx = hn::LoadU(d, b.beams + kBeam * b.lines + v),
               dy = hn::LoadU(d, b.beams + (kBeam + 1) * b.lines + v),
               dz = hn::LoadU(d, b.beams + (kBeam + 2) * b.lines + v);
    const auto zero = hn::Zero(d);
    const auto labels = hn::Set(di, b.label_count), byte = hn::Set(di, 0xFF);
    const auto reach = hn::Set(di, static_cast<std::int32_t>(48 * physical::kSurfaceReachVx) + 1);
    const auto rough_mm = hn::Set(d, b.roughness_mm / 32);
    const auto step_mm = hn::Set(d, b.voxel_mm / 48);
    for (int row = 0; row < c.rows; ++row) {
        const auto record = hn::Load(di, c.record.row(row));
        const auto second = hn::And(record, byte);
        const auto steps = hn::ShiftRight<24>(hn::ShiftLeft<16>(record));  // of distance
        const auto near = hn::And(hn::Lt(second, labels), hn::Lt(hn::Abs(steps), reach));
        if (hn::AllFalse(di, near)) {
            clear_surface_row(d, c, row);
            continue;
        }
        c.surfaces = true;
        const auto [nu, nv, nz] = octahedral_normal(d, record);
        const auto square = hn::Add(hn::Add(hn::Mul(nu, nu), hn::Mul(nv, nv)), hn::Mul(nz, nz));
        const auto inverse =
            hn::Mul(inverse_root(d, hn::Mul(square, hn::Set(d, 1.0f / (127 * 127)))),
                    hn::Set(d, 1.0f / 127));

        const auto rough = rough_at(d, b, c, row);
        const auto own = hn::Load(di, c.label.row(row));
        const auto pair = hn::GatherIndex(
            di, b.pairs, hn::IfThenElseZero(near, hn::Add(hn::Mul(own, labels), second)));
        const auto along_normal = hn::Add(hn::Mul(nu, hn::Load(d, c.off_x.row(row))),
                                          hn::Add(hn::Mul(nv, hn::Load(d, c.off_y.row(row))),
                                                  hn::Mul(nz, hn::Load(d, c.off_z.row(row)))));
        auto plane = hn::Add(hn::Mul(hn::ConvertTo(d, steps),
                                     c.regional ? hn::Load(d, c.step_mm.row(row)) : step_mm),
                             hn::Mul(hn::Mul(along_normal, inverse), hn::Set(d, b.voxel_mm)));
        if (c.regional) plane = hn::Max(plane, hn::Load(d, c.least_mm.row(row)));
        const auto shift = hn::Mul(signed_byte<0>(d, rough), rough_mm);
        const auto lower = hn::RebindMask(d, hn::Lt(own, second));
        auto distance = hn::Add(plane, hn::IfThenElse(lower, shift, hn::Neg(shift)));
        if (b.pulse_mm != 0) {
            const auto pulse = hn::Set(d, b.pulse_mm);
            const auto swells = hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairOwnPulse)));
            const auto yields = hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairSecondPulse)));
            distance = hn::Add(distance, hn::Sub(hn::IfThenElseZero(swells, pulse),
                                                 hn::IfThenElseZero(yields, pulse)));
        }
        const auto beyond = hn::And(near, hn::RebindMask(di, hn::Lt(distance, zero)));
        hn::Store(hn::IfThenElse(beyond, second, own), di, c.label.row(row));

        auto cosine = hn::Abs(
            hn::Mul(hn::Add(hn::Mul(nu, dx), hn::Add(hn::Mul(nv, dy), hn::Mul(nz, dz))), inverse));
        if (b.press != nullptr)
            press_surface(d, b, v, c.first + row, hn::Mul(nu, inverse), hn::Mul(nv, inverse),
                          hn::Mul(nz, inverse), cosine, distance);
        const auto c2 = hn::Mul(cosine, cosine), c4 = hn::Mul(c2, c2), c6 = hn::Mul(c4, c2);
        const auto hard = hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairHard)));
        const auto mirror = hn::IfThenElse(
            hard, hn::Add(hn::Mul(hn::Set(d, 0.25f), cosine), hn::Mul(hn::Set(d, 0.75f), c6)),
            hn::Add(hn::Mul(hn::Set(d, 0.08f), cosine),
                    hn::Mul(hn::Set(d, 0.92f), hn::Mul(c6, c4))));
        hn::Store(hn::IfThenElse(hn::RebindMask(d, near), mirror, hn::Set(d, 1.0f)), d,
                  c.facing.row(row));
        auto echo_re = zero, echo_im = zero;
        if (b.interfaces) {
            const auto code = hn::And(pair, hn::Set(di, 0xFFF));
            const auto per_sigma = hn::Mul(
                hn::ConvertTo(d, hn::And(hn::ShiftRight<12>(pair), byte)), hn::Set(d, 1.0f / 32));
            const auto split =
                hn::Mul(hn::ConvertTo(d, hn::ShiftRight<24>(pair)), hn::Set(d, 1.0f / 128));
            const auto u = hn::Mul(hn::Sub(hn::Abs(distance), split), per_sigma);
            const auto exponent =
                hn::Add(hn::Add(hn::Mul(hn::ConvertTo(d, hn::Sub(code, hn::Set(di, 2048))),
                                        hn::Set(d, 1.0f / 128)),
                                hn::Mul(signed_byte<1>(d, rough), hn::Set(d, 1.0f / 32))),
                        hn::Mul(hn::Mul(u, u), hn::Set(d, -0.72134752f)));
            const auto lit = hn::RebindMask(d, hn::Gt(code, hn::Zero(di)));
            const auto echo = hn::IfThenElseZero(
                lit, hn::Mul(hn::Mul(exp2_fading(d, exponent), mirror),
                             hn::Set(d, b.interface_scale[c.first + row] / 127)));
            echo_re = hn::Mul(echo, signed_byte<2>(d, rough));
            echo_im = hn::Mul(echo, signed_byte<3>(d, rough));
        }
        hn::Store(echo_re, d, c.echo_re.row(row));
        hn::Store(echo_im, d, c.echo_im.row(row));
        auto loss = zero;
        if (b.edge_shadow) {
            const auto refracts = hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairRefracts)));
            if (!hn::AllFalse(d, refracts)) {
                loss = hn::IfThenElseZero(refracts, graze_loss(d, cosine, distance));
                c.refracts = true;
            }
        }
        hn::Store(loss, d, c.edge_loss.row(row));
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
