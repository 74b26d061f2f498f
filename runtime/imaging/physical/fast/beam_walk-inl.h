// SPDX-License-Identifier: Apache-2.0

// Effects contact, deformation and breathing: where the samples of a vector of beams lie, in voxels
// or in cells of scatterers. Included once per instruction set.
#include "runtime/imaging/simd/simd_math-inl.h"
//
#include "runtime/imaging/physical/fast/physical_kernels.h"

#if defined(SONOCASE_BEAM_WALK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_WALK_INL_H
#undef SONOCASE_BEAM_WALK_INL_H
#else
#define SONOCASE_BEAM_WALK_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

template <class D>
struct BeamPoint {
    hn::Vec<D> x, y, z;
};

// Weight of the breathing shift at a row: between the nodes of its field.
template <class D>
HWY_INLINE hn::Vec<D> breathing_weight(D d, const PhysicalBlock& b, int beam, int k) {
    const float* node = b.breathing + (k / kBreathingNode) * b.lines + beam;
    const auto w0 = hn::LoadU(d, node), w1 = hn::LoadU(d, node + b.lines);
    const auto part = hn::Set(d, static_cast<float>(k % kBreathingNode) / kBreathingNode);
    return hn::Add(w0, hn::Mul(hn::Sub(w1, w0), part));
}

// A vector of beams: origin + s * per_mm, s from the probe's face, where the gap to the skin is
// closed; from there to where pressed tissue lies at rest; less the breathing shift.
template <class D>
struct BeamWalk {
    hn::Vec<D> ox, oy, oz, vx, vy, vz, gap;
    const float* shift;     // of breathing at weight 1
    const float* sideways;  // row of numbers per mm beside the beam

    HWY_INLINE BeamPoint<D> at(D d, const PhysicalBlock& b, int beam, int k) const {
        auto s = hn::Add(hn::Set(d, b.r[k]), hn::Mul(gap, hn::Set(d, b.contact[k])));
        if (b.press != nullptr) s = hn::Add(s, hn::Load(d, b.press->along_row(k) + beam));
        BeamPoint<D> p{hn::Add(ox, hn::Mul(vx, s)), hn::Add(oy, hn::Mul(vy, s)),
                       hn::Add(oz, hn::Mul(vz, s))};
        if (b.press != nullptr) {
            const auto side = hn::Load(d, b.press->side_row(k) + beam);
            p.x = hn::Add(p.x, hn::Mul(side, hn::LoadU(d, sideways)));
            p.y = hn::Add(p.y, hn::Mul(side, hn::LoadU(d, sideways + b.lines)));
            p.z = hn::Add(p.z, hn::Mul(side, hn::LoadU(d, sideways + 2 * b.lines)));
        }
        if (b.breathing != nullptr) {
            const auto w = breathing_weight(d, b, beam, k);
            p.x = hn::Sub(p.x, hn::Mul(w, hn::Set(d, shift[0])));
            p.y = hn::Sub(p.y, hn::Mul(w, hn::Set(d, shift[1])));
            p.z = hn::Sub(p.z, hn::Mul(w, hn::Set(d, shift[2])));
        }
        return p;
    }
};

// beam: the vector's first. origin, per_mm: rows of the block's numbers per beam.
template <class D>
HWY_INLINE BeamWalk<D> beam_walk(
    D d, const PhysicalBlock& b, int beam, int origin, int per_mm, const float* shift) {
    const auto number = [&](int row)
                            HWY_ATTR { return hn::LoadU(d, b.beams + row * b.lines + beam); };
    return {number(origin),
            number(origin + 1),
            number(origin + 2),
            number(per_mm),
            number(per_mm + 1),
            number(per_mm + 2),
            number(kGap),
            shift,
            b.beams + (per_mm + kSideways) * b.lines + beam};
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
