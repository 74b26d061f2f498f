// SPDX-License-Identifier: Apache-2.0

// Effect deformation: where the tissue of a stretch lies at rest, surfaces that turn with it, and
// lumens that are shut. Positions take the shift in beam_walk-inl.h.
#include "runtime/imaging/press/press_view-inl.h"
//
#include "runtime/imaging/physical/fast/beam_chunk.h"
#include "runtime/imaging/physical/model/pressed_surface.h"

#if defined(SONOCASE_BEAM_PRESS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_PRESS_INL_H
#undef SONOCASE_BEAM_PRESS_INL_H
#else
#define SONOCASE_BEAM_PRESS_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE void press_stretch(D d, const PhysicalBlock& b, const BeamChunk& c) {
    // Below the last sample that moves, nothing does.
    press::HWY_NAMESPACE::press_chunk(d, *b.press_view, b.first_beam, c.beam, c.first, c.rows,
                                      *b.press);
}

// model/pressed_surface.h, in lanes. nx, ny, nz: unit normal at rest; k: sample.
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
    const auto length2 = hn::Min(
        hn::Max(hn::Add(left, hn::Add(square(steep), square(tilted))),
                hn::Set(d, static_cast<float>(physical::kLeastSlope * physical::kLeastSlope))),
        hn::Set(d, static_cast<float>(physical::kMostSlope * physical::kMostSlope)));
    const auto per_length = hn::Div(one, hn::Sqrt(length2));
    cosine = hn::Min(hn::Abs(hn::Mul(steep, per_length)), one);
    distance_mm = hn::Mul(distance_mm, per_length);
}

// A lumen that is shut shows the tissue around it.
template <class D>
HWY_NOINLINE void close_chunk(D, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    for (int row = 0; row < c.rows; ++row) {
        const auto shut = hn::Load(di, b.press->closed + row * press::kPressBeams + c.beam);
        const auto is_shut = hn::Gt(shut, hn::Zero(di));
        if (hn::AllFalse(di, is_shut)) continue;
        const auto label = hn::Load(di, c.label.row(row));
        const auto wall = hn::GatherIndex(di, b.closed_label, label);
        hn::Store(hn::IfThenElse(is_shut, wall, label), di, c.label.row(row));
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
