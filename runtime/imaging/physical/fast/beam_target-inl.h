// SPDX-License-Identifier: Apache-2.0

// Effect targets: the exercise's balls, over the anatomy.
#include "runtime/imaging/physical/fast/beam_surface-inl.h"

#if defined(SONOCASE_BEAM_TARGET_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_TARGET_INL_H
#undef SONOCASE_BEAM_TARGET_INL_H
#else
#define SONOCASE_BEAM_TARGET_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

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
    auto distance = hn::Sub(away, hn::Set(d, ball.radius_mm));
    const auto reached = hn::Le(distance, hn::Set(d, static_cast<float>(physical::kTargetReachMm)));
    if (hn::AllFalse(d, reached)) return;
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
        hn::Add(distance, hn::Mul(signed_byte<0>(d, rough),
                                  hn::Set(d, static_cast<float>(physical::kRoughnessMm) / 32)));
    const auto at = [&](int axis)
                        HWY_ATTR { return hn::LoadU(d, b.beams + (kBeam + axis) * b.lines + v); };
    const auto cosine = hn::Div(
        hn::Abs(hn::Add(hn::Add(hn::Mul(fx, at(0)), hn::Mul(fy, at(1))), hn::Mul(fz, at(2)))),
        hn::Max(away, hn::Set(d, 1e-3f)));
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
