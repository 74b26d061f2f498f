// SPDX-License-Identifier: Apache-2.0

// Surfaces of a stretch of beams. Effect deformation: surfaces that turn with pressed tissue, and
// collapsed lumens; beam_place-inl.h shifts the positions. Effects boundaries, pulsation,
// interfaces and edge_shadow: on which side of the plane in its voxel a sample lies, and what the
// surface itself reflects and takes away. Effect targets: the exercise's balls and ellipsoids,
// over the anatomy.
#include "formats/volume/boundary_record.h"
#include "runtime/imaging/core/simd_math-inl.h"
#include "runtime/imaging/physical/fast/beam_chunk.h"
#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/press/press_view-inl.h"

#if defined(SONOCASE_BEAM_SURFACE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_SURFACE_INL_H
#undef SONOCASE_BEAM_SURFACE_INL_H
#else
#define SONOCASE_BEAM_SURFACE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE void press_stretch(D d, const PhysicalBlock& b, const BeamChunk& c) {
    press::HWY_NAMESPACE::press_chunk(d, *b.press_view, b.first_beam, c.beam, c.first, c.rows,
                                      *b.press);
}

// physical::press_surface() in lanes. nx, ny, nz: unit normal at rest; k: sample.
template <class D, class V>
HWY_INLINE void press_surface(
    D d, const PhysicalBlock& b, int beam, int k, V nx, V ny, V nz, V& cosine, V& distance_mm) {
    const auto along_axes = [&](int row, float scale) HWY_ATTR {
        const float* axis = b.beams + row * b.lines + beam;
        const auto sum = hn::Add(hn::Mul(nx, hn::LoadU(d, axis)),
                                 hn::Add(hn::Mul(ny, hn::LoadU(d, axis + b.lines)),
                                         hn::Mul(nz, hn::LoadU(d, axis + 2 * b.lines))));
        return hn::Mul(sum, hn::Set(d, scale));
    };
    const auto one = hn::Set(d, 1.0f);
    const auto along = along_axes(kBeam, 1),
               beside = along_axes(kSideways + kVoxelPerMm, b.voxel_mm);
    const float* here = b.press->along_row(k) + beam;
    const auto deeper = hn::Sub(hn::Load(d, here), hn::Load(d, here - press::kPressBeams));
    const auto rise = hn::Add(one, hn::Mul(deeper, hn::Set(d, 1 / b.step_mm)));
    const auto steep = hn::Mul(along, rise);
    const auto tilt = press::HWY_NAMESPACE::press_tilt(d, *b.press_view, b.first_beam + beam, k);
    const auto tilted = hn::Add(beside, hn::Mul(along, tilt));
    const auto square = [&](auto x) HWY_ATTR { return hn::Mul(x, x); };
    const auto left = hn::Max(hn::Sub(hn::Sub(one, square(along)), square(beside)), hn::Zero(d));
    const auto length2 =
        hn::Min(hn::Max(hn::Add(left, hn::Add(square(steep), square(tilted))),
                        hn::Set(d, static_cast<float>(physical::kMinSlope * physical::kMinSlope))),
                hn::Set(d, static_cast<float>(physical::kMaxSlope * physical::kMaxSlope)));
    const auto per_length = hn::Div(one, hn::Sqrt(length2));
    cosine = hn::Min(hn::Abs(hn::Mul(steep, per_length)), one);
    distance_mm = hn::Mul(distance_mm, per_length);
}

// A collapsed lumen shows the tissue around it.
template <class D>
HWY_NOINLINE void close_chunk(D, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    for (int row = 0; row < c.rows; ++row) {
        const auto closed = hn::Load(di, b.press->closed + row * press::kPressBeams + c.beam);
        const auto is_closed = hn::Gt(closed, hn::Zero(di));
        if (hn::AllFalse(di, is_closed)) continue;
        const auto label = hn::Load(di, c.label.row(row));
        const auto wall = hn::GatherIndex(di, b.closed_label, label);
        hn::Store(hn::IfThenElse(is_closed, wall, label), di, c.label.row(row));
    }
}

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

// Reads the records of the voxels that are looked up.
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

// The label of each sample by the side of the surface that it lies on, and the echo, the loss and
// the facing of that surface.
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
        if (c.regional) plane = hn::Max(plane, hn::Load(d, c.min_mm.row(row)));
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
        if (b.vein_mm != 0) {
            const auto wall = hn::Set(d, b.vein_mm);
            const auto one = hn::Set(di, 1);
            const auto inside = hn::Eq(hn::GatherIndex(di, b.is_vein, own), one);
            const auto beside = hn::AndNot(
                inside,
                hn::Eq(hn::GatherIndex(di, b.is_vein, hn::IfThenElseZero(near, second)), one));
            distance =
                hn::Add(distance, hn::Sub(hn::IfThenElseZero(hn::RebindMask(d, inside), wall),
                                          hn::IfThenElseZero(hn::RebindMask(d, beside), wall)));
        }
        const auto beyond = hn::And(near, hn::RebindMask(di, hn::Lt(distance, zero)));
        hn::Store(hn::IfThenElse(beyond, second, own), di, c.label.row(row));

        auto cosine = hn::Abs(
            hn::Mul(hn::Add(hn::Mul(nu, dx), hn::Add(hn::Mul(nv, dy), hn::Mul(nz, dz))), inverse));
        if (b.press != nullptr)
            press_surface(d, b, v, c.first + row, hn::Mul(nu, inverse), hn::Mul(nv, inverse),
                          hn::Mul(nz, inverse), cosine, distance);
        const auto c2 = hn::Mul(cosine, cosine), c4 = hn::Mul(c2, c2), c6 = hn::Mul(c4, c2);
        const auto diffuse = hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairDiffuse)));
        constexpr auto kPart = static_cast<float>(physical::kDiffusePart);
        const auto mirror = hn::IfThenElse(
            diffuse,
            hn::Add(hn::Mul(hn::Set(d, kPart), cosine), hn::Mul(hn::Set(d, 1 - kPart), c6)),
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

// How samples lie about the surface of a target: half the gradient of the quadratic form that rises
// outwards, its length, and the distance to the surface in mm, to first order.
template <class V>
struct AboutTarget {
    V x, y, z, length, distance_mm;
};

// f: offset from the centre, mm; away: its length.
template <class D, class V = hn::Vec<D>>
HWY_INLINE AboutTarget<V> about_target(D d, const PhysicalTarget& t, V fx, V fy, V fz, V away) {
    if (t.round) return {fx, fy, fz, away, hn::Sub(away, hn::Set(d, t.radius_mm))};
    const auto row = [&](int a, int b, int c) HWY_ATTR {
        return hn::Add(
            hn::Add(hn::Mul(hn::Set(d, t.shape[a]), fx), hn::Mul(hn::Set(d, t.shape[b]), fy)),
            hn::Mul(hn::Set(d, t.shape[c]), fz));
    };
    const auto x = row(0, 3, 4), y = row(3, 1, 5), z = row(4, 5, 2);
    const auto tiny = hn::Set(d, 1e-3f);
    const auto rank = hn::Sqrt(hn::Add(hn::Add(hn::Mul(fx, x), hn::Mul(fy, y)), hn::Mul(fz, z)));
    const auto length =
        hn::Max(hn::Sqrt(hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z))), tiny);
    return {x, y, z, length,
            hn::Mul(hn::Sub(rank, hn::Set(d, t.radius_mm)), hn::Div(hn::Max(rank, tiny), length))};
}

template <class D>
HWY_INLINE void target_row(
    D d, const PhysicalBlock& b, const PhysicalTarget& ball, BeamChunk& c, int row, bool& met) {
    const hn::RebindToSigned<D> di;
    const int v = c.beam;
    const auto mm = hn::Set(d, b.voxel_mm), zero = hn::Zero(d);
    const auto from = [&](const float* p, float centre) HWY_ATTR {
        return hn::Mul(hn::Sub(hn::Load(d, p), hn::Set(d, centre)), mm);
    };
    const auto fx = from(c.x.row(row), ball.x), fy = from(c.y.row(row), ball.y),
               fz = from(c.z.row(row), ball.z);
    const auto away = hn::Sqrt(hn::Add(hn::Add(hn::Mul(fx, fx), hn::Mul(fy, fy)), hn::Mul(fz, fz)));
    const auto reach = hn::Set(d, static_cast<float>(physical::kTargetReachMm));
    if (hn::AllFalse(d, hn::Le(hn::Sub(away, hn::Set(d, ball.reach_mm)), reach))) return;
    const auto about = about_target(d, ball, fx, fy, fz, away);
    auto distance = about.distance_mm;
    const auto reached = hn::Le(distance, reach);
    const auto own = hn::Load(di, c.label.row(row));
    if (ball.only_label >= 0) {
        const auto height = hn::MulAdd(fx, hn::Set(d, ball.level_up[0]),
                                       hn::MulAdd(fy, hn::Set(d, ball.level_up[1]),
                                                  hn::Mul(fz, hn::Set(d, ball.level_up[2]))));
        const auto wet = hn::And(hn::Lt(distance, zero), hn::Lt(height, hn::Set(d, ball.level_mm)));
        const auto within =
            hn::And(hn::RebindMask(di, wet), hn::Eq(own, hn::Set(di, ball.only_label)));
        if (hn::AllFalse(di, within)) return;
        met = true;
        hn::Store(hn::IfThenElse(within, hn::Set(di, ball.acoustics), own), di, c.label.row(row));
        return;
    }
    const auto kind =
        hn::And(hn::ShiftRight<16>(hn::GatherIndex(di, b.acoustics, own)), hn::Set(di, 7));
    // A ball replaces soft tissue, and also an earlier ball, which lies in soft tissue.
    auto soft = hn::Or(hn::Eq(kind, hn::Set(di, static_cast<std::int32_t>(kPackedSoft))),
                       hn::Gt(own, hn::Set(di, b.label_count - 1)));
    if (ball.anywhere)
        soft = hn::Or(soft, hn::Eq(kind, hn::Set(di, static_cast<std::int32_t>(kPackedFluid))));
    const auto close = hn::And(reached, hn::RebindMask(d, soft));
    if (hn::AllFalse(d, close)) return;
    met = true;
    if (!c.surfaces) {
        c.surfaces = true;
        for (int r = 0; r < c.rows; ++r) clear_surface_row(d, c, r);
    }
    const auto rough = rough_at(d, b, c, row);
    distance =
        hn::Add(distance, hn::Mul(signed_byte<0>(d, rough), hn::Set(d, b.roughness_mm / 32)));
    const auto at = [&](int axis)
                        HWY_ATTR { return hn::LoadU(d, b.beams + (kBeam + axis) * b.lines + v); };
    const auto cosine =
        hn::Div(hn::Abs(hn::Add(hn::Add(hn::Mul(about.x, at(0)), hn::Mul(about.y, at(1))),
                                hn::Mul(about.z, at(2)))),
                hn::Max(about.length, hn::Set(d, 1e-3f)));
    const auto within = hn::RebindMask(di, hn::And(close, hn::Lt(distance, zero)));
    hn::Store(hn::IfThenElse(within, hn::Set(di, ball.acoustics), own), di, c.label.row(row));
    if (ball.covers) {
        const auto inner = hn::RebindMask(d, within);
        for (float* of : {c.echo_re.row(row), c.echo_im.row(row)})
            hn::Store(hn::IfThenZeroElse(inner, hn::Load(d, of)), d, of);
        float* facing = c.facing.row(row);
        hn::Store(hn::IfThenElse(inner, hn::Set(d, 1.0f), hn::Load(d, facing)), d, facing);
    }
    if (b.interfaces) {
        const auto u = hn::Mul(distance, hn::Set(d, 1 / 0.16f));
        const auto c2 = hn::Mul(cosine, cosine);
        const auto mirror = hn::Add(hn::Mul(hn::Set(d, 0.08f), cosine),
                                    hn::Mul(hn::Set(d, 0.92f), hn::Mul(hn::Mul(c2, c2), c2)));
        const auto glint = hn::Mul(signed_byte<1>(d, rough), hn::Set(d, 1.0f / 32));
        const auto profile =
            exp2_fading(d, hn::Add(glint, hn::Mul(hn::Mul(u, u), hn::Set(d, -0.72134752f))));
        const auto echo = hn::IfThenElseZero(
            close, hn::Mul(hn::Mul(profile, mirror),
                           hn::Set(d, ball.wall * b.interface_scale[c.first + row] / 127)));
        float *re = c.echo_re.row(row), *im = c.echo_im.row(row);
        hn::Store(hn::Add(hn::Load(d, re), hn::Mul(echo, signed_byte<2>(d, rough))), d, re);
        hn::Store(hn::Add(hn::Load(d, im), hn::Mul(echo, signed_byte<3>(d, rough))), d, im);
    }
    if (b.edge_shadow && ball.fluid) {
        float* loss = c.edge_loss.row(row);
        hn::Store(
            hn::Add(hn::Load(d, loss), hn::IfThenElseZero(close, graze_loss(d, cosine, distance))),
            d, loss);
        c.refracts = true;
    }
}

// Returns whether a target shows in the stretch.
template <class D>
HWY_NOINLINE bool target_chunk(D d, const PhysicalBlock& b, BeamChunk& c) {
    bool met = false;
    for (int t = 0; t < b.target_count; ++t) {
        const int begin = std::max(b.target_rows[t].begin - c.first, 0),
                  end = std::min(b.target_rows[t].end - c.first, c.rows);
        for (int row = begin; row < end; ++row) target_row(d, b, b.targets[t], c, row, met);
    }
    return met;
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
