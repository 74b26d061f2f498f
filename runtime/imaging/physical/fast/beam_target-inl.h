// SPDX-License-Identifier: Apache-2.0

// Effect targets: the exercise's balls and ellipsoids, over the anatomy.
#include "runtime/imaging/physical/fast/beam_surface-inl.h"

#if defined(SONOCASE_BEAM_TARGET_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_TARGET_INL_H
#undef SONOCASE_BEAM_TARGET_INL_H
#else
#define SONOCASE_BEAM_TARGET_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// Where samples lie about the surface of a target: half the gradient of what rises outwards, its
// length, and the distance to the surface in mm, to first order.
template <class V>
struct AboutTarget {
    V x, y, z, length, distance_mm;
};

// f: from the centre, mm; away: its length.
template <class D, class V = hn::Vec<D>>
HWY_INLINE AboutTarget<V> about_target(D d, const PhysicalTarget& t, V fx, V fy, V fz, V away) {
    if (t.round) return {fx, fy, fz, away, hn::Sub(away, hn::Set(d, t.radius_mm))};
    const auto row = [&](int a, int b, int c) HWY_ATTR {
        return hn::Add(
            hn::Add(hn::Mul(hn::Set(d, t.shape[a]), fx), hn::Mul(hn::Set(d, t.shape[b]), fy)),
            hn::Mul(hn::Set(d, t.shape[c]), fz));
    };
    const auto x = row(0, 3, 4), y = row(3, 1, 5), z = row(4, 5, 2);
    const auto least = hn::Set(d, 1e-3f);
    const auto rank = hn::Sqrt(hn::Add(hn::Add(hn::Mul(fx, x), hn::Mul(fy, y)), hn::Mul(fz, z)));
    const auto length =
        hn::Max(hn::Sqrt(hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z))), least);
    return {x, y, z, length,
            hn::Mul(hn::Sub(rank, hn::Set(d, t.radius_mm)), hn::Div(hn::Max(rank, least), length))};
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
    const auto kind =
        hn::And(hn::ShiftRight<16>(hn::GatherIndex(di, b.looks, own)), hn::Set(di, 7));
    // A ball replaces soft tissue, and also an earlier ball, which lies in soft tissue.
    const auto soft = hn::Or(hn::Eq(kind, hn::Set(di, static_cast<std::int32_t>(kPackedSoft))),
                             hn::Gt(own, hn::Set(di, b.label_count - 1)));
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
    hn::Store(hn::IfThenElse(within, hn::Set(di, ball.look), own), di, c.label.row(row));
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
        for (int row = 0; row < c.rows; ++row) target_row(d, b, b.targets[t], c, row, met);
    }
    return met;
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
