// SPDX-License-Identifier: Apache-2.0

// Effect speckle: the three scatterers of each sample. See physical/model/speckle.h.
#include "runtime/imaging/physical/fast/beam_walk-inl.h"
//
#include "runtime/imaging/physical/fast/beam_chunk.h"

#if defined(SONOCASE_BEAM_SPECKLE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_SPECKLE_INL_H
#undef SONOCASE_BEAM_SPECKLE_INL_H
#else
#define SONOCASE_BEAM_SPECKLE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

template <class D>
struct Scatterers {
    hn::Vec<D> weight[3];
    hn::Vec<hn::RebindToUnsigned<D>> bits[3];
};

// Height and foot (at height 0) of a row's samples, and what their axis adds per height.
template <class D>
struct SpeckleFoot {
    hn::Vec<D> height, u, v, u_per_height, v_per_height, per_normal;
    hn::Vec<hn::RebindToUnsigned<D>> base;
};

template <class DU>
HWY_INLINE hn::Vec<DU> mix_bits(DU du, hn::Vec<DU> h, std::uint32_t factor, hn::Vec<DU> shifted) {
    return hn::Mul(hn::Xor(h, shifted), hn::Set(du, factor));
}

// The draw of each sample's patch of tissue: mix_patch().
template <class D>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<D>> patch_draw(D d,
                                                       const PhysicalBlock& b,
                                                       int beam,
                                                       int k) {
    using namespace physical;
    const hn::RebindToUnsigned<D> du;
    const hn::RebindToSigned<D> di;
    const auto p =
        beam_walk(d, b, beam, kVoxelOrigin, kVoxelPerMm, b.shift_voxel).at(d, b, beam, k);
    const auto scale = hn::Set(d, b.patch_per_voxel);
    const auto term = [&](auto x, std::uint32_t factor) HWY_ATTR {
        const auto cell = hn::Sub(rounded_bits(d, hn::Mul(x, scale)), hn::Set(di, kRoundingBits));
        return hn::Mul(hn::BitCast(du, cell), hn::Set(du, factor));
    };
    const auto sum = hn::Add(hn::Add(term(p.x, kNodeU), term(p.y, kNodeV)), term(p.z, kNodeBlock));
    const auto node = mix_bits(du, sum, 0x2C1B3C6Du, hn::ShiftRight<16>(sum));
    return mix_bits(du, node, 0x297A2D39u, hn::ShiftRight<15>(node));
}

template <class D>
HWY_INLINE SpeckleFoot<D> foot_of_side(D d, const PhysicalBlock& b, int side, int beam, int k) {
    const hn::RebindToUnsigned<D> du;
    const SpeckleCut& cut = b.cuts[side];
    const auto p =
        beam_walk(d, b, beam, kSpeckleOrigin + 6 * side, kSpecklePerMm + 6 * side, cut.shift)
            .at(d, b, beam, k);
    return {p.x,
            p.y,
            p.z,
            hn::Set(d, cut.u_per_height),
            hn::Set(d, cut.v_per_height),
            hn::Set(d, cut.per_normal),
            hn::Set(du, cut.base)};
}

// Where more than one axis counts: each patch's own.
template <class D>
HWY_INLINE SpeckleFoot<D> foot_of_patch(
    D d, const PhysicalBlock& b, hn::Vec<hn::RebindToUnsigned<D>> patch, int beam, int k) {
    const hn::RebindToUnsigned<D> du;
    const hn::RebindToSigned<D> di;
    SpeckleFoot<D> foot = foot_of_side(d, b, 0, beam, k);
    const auto draw = hn::BitCast(di, hn::ShiftRight<16>(patch));
    for (int side = 1; side < b.cut_count; ++side) {
        const SpeckleFoot<D> other = foot_of_side(d, b, side, beam, k);
        const auto beyond = hn::Gt(draw, hn::Set(di, b.cuts[side - 1].until - 1));
        const auto mine = hn::RebindMask(d, beyond);
        foot.height = hn::IfThenElse(mine, other.height, foot.height);
        foot.u = hn::IfThenElse(mine, other.u, foot.u);
        foot.v = hn::IfThenElse(mine, other.v, foot.v);
        foot.u_per_height = hn::IfThenElse(mine, other.u_per_height, foot.u_per_height);
        foot.v_per_height = hn::IfThenElse(mine, other.v_per_height, foot.v_per_height);
        foot.per_normal = hn::IfThenElse(mine, other.per_normal, foot.per_normal);
        foot.base = hn::IfThenElse(hn::RebindMask(du, beyond), other.base, foot.base);
    }
    return foot;
}

template <class D>
HWY_INLINE Scatterers<D> scatterers_of_row(D d, const PhysicalBlock& b, int beam, int k) {
    using namespace physical;
    const hn::RebindToUnsigned<D> du;
    const hn::RebindToSigned<D> di;
    const auto shift = hn::Set(d, kRoundingShift), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
    auto patch = hn::Zero(du);
    if (b.cut_count > 1) patch = patch_draw(d, b, beam, k);
    const SpeckleFoot<D> foot =
        b.cut_count > 1 ? foot_of_patch(d, b, patch, beam, k) : foot_of_side(d, b, 0, beam, k);

    // The block of heights; within a quarter of its ends, patches pass one by one.
    auto at = hn::Mul(foot.height, hn::Set(d, 1.0f / kHeightBlock));
    const auto end = hn::Sub(hn::Add(at, shift), shift);  // the nearest
    if (!hn::AllTrue(d, hn::Gt(hn::Abs(hn::Sub(at, end)), hn::Set(d, 0.25f)))) {
        if (b.cut_count == 1) patch = patch_draw(d, b, beam, k);
        const auto draw = hn::ConvertTo(d, hn::BitCast(di, hn::And(patch, hn::Set(du, 0xFFFFu))));
        at = hn::Add(at, hn::Sub(hn::Mul(draw, hn::Set(d, 0.5f / 65536)), hn::Set(d, 0.25f)));
    }
    const auto block_bits = hn::Add(hn::Sub(at, half), shift);
    const auto middle = hn::Mul(hn::Add(hn::Sub(block_bits, shift), half),
                                hn::Set(d, static_cast<float>(kHeightBlock)));

    // The triangle around the foot.
    const auto u = hn::Add(foot.u, hn::Mul(middle, foot.u_per_height)),
               v = hn::Add(foot.v, hn::Mul(middle, foot.v_per_height));
    const auto u_bits = hn::Add(hn::Sub(u, half), shift), v_bits = hn::Add(hn::Sub(v, half), shift);
    const auto fu = hn::Sub(u, hn::Sub(u_bits, shift)), fv = hn::Sub(v, hn::Sub(v_bits, shift));
    const auto more = hn::Max(fu, fv), less = hn::Min(fu, fv);
    const hn::Vec<D> blend[3] = {hn::Sub(one, more), hn::Sub(more, less), less};
    const auto term = [&](auto bits, std::uint32_t factor)
                          HWY_ATTR { return hn::Mul(hn::BitCast(du, bits), hn::Set(du, factor)); };
    constexpr std::uint32_t kBits = static_cast<std::uint32_t>(kRoundingBits);
    const auto sum = hn::Add(
        hn::Add(hn::Add(term(u_bits, kNodeU), term(v_bits, kNodeV)), term(block_bits, kNodeBlock)),
        hn::Sub(foot.base, hn::Set(du, kBits * (kNodeU + kNodeV + kNodeBlock))));
    const auto u_first = hn::RebindMask(du, hn::Gt(fu, fv));
    const hn::Vec<decltype(du)> sums[3] = {
        sum, hn::Add(sum, hn::IfThenElse(u_first, hn::Set(du, kNodeU), hn::Set(du, kNodeV))),
        hn::Add(sum, hn::Set(du, kNodeU + kNodeV))};

    // Of each node, the scatterer nearest to the plane.
    const auto depth = hn::Add(hn::Mul(hn::Sub(foot.height, middle),
                                       hn::Mul(foot.per_normal, hn::Set(d, b.per_spacing[k]))),
                               one);  // as the beginnings below, which lie in [1, 2)
    Scatterers<D> out;
    const auto scatterer = [&](int i) HWY_ATTR {
        const auto node = mix_bits(du, sums[i], 0x2C1B3C6Du, hn::ShiftRight<16>(sums[i]));
        const auto begin =
            hn::BitCast(d, hn::Or(hn::ShiftRight<9>(node), hn::Set(du, 0x3F800000u)));
        const auto from = hn::Sub(depth, begin);
        const auto step_bits = hn::Add(from, shift);
        const auto off = hn::Sub(from, hn::Sub(step_bits, shift));
        static_assert(kBits << kStepShift == 0);
        const auto h = hn::Add(node, hn::ShiftLeft<kStepShift>(hn::BitCast(du, step_bits)));
        out.bits[i] = mix_bits(du, h, 0x297A2D39u, hn::ShiftRight<15>(h));
        const auto square = hn::Mul(off, off),
                   most = hn::Sub(one, hn::Mul(square, hn::Set(d, 3.0f)));
        out.weight[i] = hn::Mul(hn::Mul(blend[i], most), hn::Sub(most, square));
    };
    scatterer(0);
    scatterer(1);
    scatterer(2);
    return out;
}

// The field of one look: the signs of its parts are the top bits of the scatterers, which move on
// for the next look if there is one.
template <class D>
HWY_INLINE void field_of_look(D d, Scatterers<D>& s, bool more, hn::Vec<D>& re, hn::Vec<D>& im) {
    const hn::RebindToUnsigned<D> du;
    const auto part = [&](int i, auto bits) HWY_ATTR {
        return hn::CopySignToAbs(s.weight[i], hn::BitCast(d, bits));  // weights are not negative
    };
    const hn::Vec<decltype(du)> second[3] = {
        hn::ShiftLeft<1>(s.bits[0]), hn::ShiftLeft<1>(s.bits[1]), hn::ShiftLeft<1>(s.bits[2])};
    re = hn::Add(hn::Add(part(0, s.bits[0]), part(1, s.bits[1])), part(2, s.bits[2]));
    im = hn::Add(hn::Add(part(0, second[0]), part(1, second[1])), part(2, second[2]));
    if (!more) return;
    for (int i = 0; i < 3; ++i) s.bits[i] = hn::ShiftLeft<1>(second[i]);
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
