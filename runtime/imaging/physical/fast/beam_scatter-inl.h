// SPDX-License-Identifier: Apache-2.0

// Effects structure, fine_structure and speckle: the three scatterers of each sample of a stretch,
// with the echoes of its surfaces. model/speckle_slice.h has the formulas.
#include "runtime/imaging/physical/fast/beam_chunk.h"
#include "runtime/imaging/physical/fast/beam_place-inl.h"

#if defined(SONOCASE_BEAM_SCATTER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_SCATTER_INL_H
#undef SONOCASE_BEAM_SCATTER_INL_H
#else
#define SONOCASE_BEAM_SCATTER_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

template <class D>
struct Scatterers {
    hn::Vec<D> weight[3];
    hn::Vec<hn::RebindToUnsigned<D>> bits[3];
};

// Where a row's samples lie on the lattice of scatterers: height above the scan plane through the
// volume's origin, the projection (u, v) at height 0, and what u and v gain per height.
template <class D>
struct SpecklePlace {
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
HWY_INLINE SpecklePlace<D> place_on_side(D d, const PhysicalBlock& b, int side, int beam, int k) {
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

// The same where more than one axis counts: each patch has its own.
template <class D>
HWY_INLINE SpecklePlace<D> place_in_patch(
    D d, const PhysicalBlock& b, hn::Vec<hn::RebindToUnsigned<D>> patch, int beam, int k) {
    const hn::RebindToUnsigned<D> du;
    const hn::RebindToSigned<D> di;
    SpecklePlace<D> place = place_on_side(d, b, 0, beam, k);
    const auto draw = hn::BitCast(di, hn::ShiftRight<16>(patch));
    for (int side = 1; side < b.cut_count; ++side) {
        const SpecklePlace<D> other = place_on_side(d, b, side, beam, k);
        const auto beyond = hn::Gt(draw, hn::Set(di, b.cuts[side - 1].until - 1));
        const auto mine = hn::RebindMask(d, beyond);
        place.height = hn::IfThenElse(mine, other.height, place.height);
        place.u = hn::IfThenElse(mine, other.u, place.u);
        place.v = hn::IfThenElse(mine, other.v, place.v);
        place.u_per_height = hn::IfThenElse(mine, other.u_per_height, place.u_per_height);
        place.v_per_height = hn::IfThenElse(mine, other.v_per_height, place.v_per_height);
        place.per_normal = hn::IfThenElse(mine, other.per_normal, place.per_normal);
        place.base = hn::IfThenElse(hn::RebindMask(du, beyond), other.base, place.base);
    }
    return place;
}

template <class D>
HWY_INLINE Scatterers<D> scatterers_of_row(D d, const PhysicalBlock& b, int beam, int k) {
    using namespace physical;
    const hn::RebindToUnsigned<D> du;
    const hn::RebindToSigned<D> di;
    const auto shift = hn::Set(d, kRoundingShift), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
    auto patch = hn::Zero(du);
    if (b.cut_count > 1) patch = patch_draw(d, b, beam, k);
    const SpecklePlace<D> place =
        b.cut_count > 1 ? place_in_patch(d, b, patch, beam, k) : place_on_side(d, b, 0, beam, k);

    // The block of heights; within a quarter of its ends, patches change over one by one.
    auto at = hn::Mul(place.height, hn::Set(d, 1.0f / kHeightBlock));
    const auto end = hn::Sub(hn::Add(at, shift), shift);  // the nearest
    if (!hn::AllTrue(d, hn::Gt(hn::Abs(hn::Sub(at, end)), hn::Set(d, 0.25f)))) {
        if (b.cut_count == 1) patch = patch_draw(d, b, beam, k);
        const auto draw = hn::ConvertTo(d, hn::BitCast(di, hn::And(patch, hn::Set(du, 0xFFFFu))));
        at = hn::Add(at, hn::Sub(hn::Mul(draw, hn::Set(d, 0.5f / 65536)), hn::Set(d, 0.25f)));
    }
    const auto block_bits = hn::Add(hn::Sub(at, half), shift);
    const auto middle = hn::Mul(hn::Add(hn::Sub(block_bits, shift), half),
                                hn::Set(d, static_cast<float>(kHeightBlock)));

    // The triangle around the projection.
    const auto u = hn::Add(place.u, hn::Mul(middle, place.u_per_height)),
               v = hn::Add(place.v, hn::Mul(middle, place.v_per_height));
    const auto u_bits = hn::Add(hn::Sub(u, half), shift), v_bits = hn::Add(hn::Sub(v, half), shift);
    const auto fu = hn::Sub(u, hn::Sub(u_bits, shift)), fv = hn::Sub(v, hn::Sub(v_bits, shift));
    const auto more = hn::Max(fu, fv), less = hn::Min(fu, fv);
    const hn::Vec<D> blend[3] = {hn::Sub(one, more), hn::Sub(more, less), less};
    const auto term = [&](auto bits, std::uint32_t factor)
                          HWY_ATTR { return hn::Mul(hn::BitCast(du, bits), hn::Set(du, factor)); };
    constexpr std::uint32_t kBits = static_cast<std::uint32_t>(kRoundingBits);
    const auto sum = hn::Add(
        hn::Add(hn::Add(term(u_bits, kNodeU), term(v_bits, kNodeV)), term(block_bits, kNodeBlock)),
        hn::Sub(place.base, hn::Set(du, kBits * (kNodeU + kNodeV + kNodeBlock))));
    const auto u_first = hn::RebindMask(du, hn::Gt(fu, fv));
    const hn::Vec<decltype(du)> sums[3] = {
        sum, hn::Add(sum, hn::IfThenElse(u_first, hn::Set(du, kNodeU), hn::Set(du, kNodeV))),
        hn::Add(sum, hn::Set(du, kNodeU + kNodeV))};

    // For each node, the scatterer nearest to the plane.
    const auto depth = hn::Add(hn::Mul(hn::Sub(place.height, middle),
                                       hn::Mul(place.per_normal, hn::Set(d, b.per_spacing[k]))),
                               one);  // the beginnings below lie in [1, 2)
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
                   bell = hn::Sub(one, hn::Mul(square, hn::Set(d, 3.0f)));
        out.weight[i] = hn::Mul(hn::Mul(blend[i], bell), hn::Sub(bell, square));
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

// Reads the acoustic properties of the labels; in most places all beams are in one label.
template <class D>
HWY_NOINLINE void acoustics_chunk(D, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const std::int32_t first = c.label.row(0)[0];
    auto other = hn::Zero(di);
    for (int row = 0; row < c.rows; ++row)
        other = hn::Or(other, hn::Xor(hn::Load(di, c.label.row(row)), hn::Set(di, first)));
    c.one_label = hn::AllTrue(di, hn::Eq(other, hn::Zero(di)));
    const auto kind_bits = hn::Set(di, 7 << 16);
    auto hardest = hn::Zero(di), any = hn::Zero(di);
    for (int row = 0; row < c.rows; ++row) {
        auto word = hn::Set(di, b.acoustics[first]);
        if (!c.one_label) word = hn::GatherIndex(di, b.acoustics, hn::Load(di, c.label.row(row)));
        hardest = hn::Max(hardest, hn::And(word, kind_bits));
        any = hn::Or(any, word);
        hn::Store(word, di, c.acoustics.row(row));
    }
    c.fine = !hn::AllFalse(di, hn::TestBit(any, hn::Set(di, kFineStructureBit)));
    c.hard =
        !hn::AllTrue(di, hn::Lt(hardest, hn::Set(di, static_cast<std::int32_t>(kPackedGas) << 16)));
}

// Reads the baked echo offsets.
template <class D>
HWY_NOINLINE void structure_chunk(D, const PhysicalBlock& block, BeamChunk& c) {
    const PhysicalBlock b = block;
    const hn::RebindToSigned<D> di;
    for (int row = 0; row < c.rows; ++row) {
        const auto word = hn::Load(di, c.echo_word.row(row));
        auto offset = word;
        if (c.echo_pooled) {
            const auto voxel = pool_byte(di, b.echo, hn::Load(di, c.structure.row(row)));
            offset = hn::IfThenElse(hn::Lt(word, hn::Zero(di)), word, voxel);
        }
        const auto label = hn::Load(di, c.label.row(row));
        auto sixteenths = hn::ShiftLeft<2>(hn::ShiftRight<24>(hn::ShiftLeft<24>(offset)));
        if (b.max_structure != nullptr)
            sixteenths = hn::Min(sixteenths, hn::GatherIndex(di, b.max_structure, label));
        if (b.structure_dead != nullptr && c.fine) {
            const auto dead = hn::GatherIndex(di, b.structure_dead, label);
            sixteenths = hn::Sub(sixteenths, hn::Max(hn::Min(sixteenths, dead), hn::Neg(dead)));
        }
        const auto tissue = hn::Lt(label, hn::Set(di, b.label_count));
        hn::Store(hn::IfThenElseZero(tissue, sixteenths), di, c.structure.row(row));
    }
}

constexpr float kParenchymaOffset = static_cast<float>(
    physical::kParenchymaCube * physical::kFineEdge * physical::kFineEdge * physical::kFineEdge);

// Echo offset of fibres, septa and parenchyma, 1/16 dB. Works label by label (mostly there is one),
// so that no lane depends on its neighbours.
template <class D>
HWY_INLINE auto fine_offset(
    D d, PhysicalBlock& b, const BeamChunk& c, const BeamPoint<D>& place, int row) {
    static_assert(physical::kFineEdge == 64);
    const hn::RebindToSigned<D> di;
    const auto fine =
        hn::TestBit(hn::Load(di, c.acoustics.row(row)), hn::Set(di, kFineStructureBit));
    auto left = fine;
    auto at = hn::Zero(di);
    const std::int32_t* labels = c.label.row(row);
    while (!hn::AllFalse(di, left)) {
        const std::int32_t label = labels[hn::FindFirstTrue(di, left)];
        const auto mine = hn::And(left, hn::Eq(hn::Load(di, labels), hn::Set(di, label)));
        const float* m = b.fine_frames + kFineNumbers * label;
        const auto coordinate = [&](int r, std::int32_t mask) HWY_ATTR {
            const auto term = [&](auto p, int axis)
                                  HWY_ATTR { return hn::Mul(p, hn::Set(d, m[3 * r + axis])); };
            const auto u = hn::Add(hn::Add(term(place.x, 0), term(place.y, 1)), term(place.z, 2));
            return hn::And(rounded_bits(d, u), hn::Set(di, mask));
        };
        // physical::fine_index()
        const auto low = hn::Set(di, 3);
        const auto u0 = coordinate(1, physical::kFineEdge - 1),
                   u1 = coordinate(2, physical::kFineEdge - 1),
                   u2 = coordinate(0, static_cast<std::int32_t>(m[10]));
        const auto in_block = hn::Or(hn::And(u0, low), hn::Or(hn::ShiftLeft<2>(hn::And(u1, low)),
                                                              hn::ShiftLeft<4>(hn::And(u2, low))));
        const auto block = hn::Or(
            hn::ShiftLeft<4>(hn::AndNot(low, u0)),
            hn::Or(hn::ShiftLeft<8>(hn::AndNot(low, u1)), hn::ShiftLeft<12>(hn::AndNot(low, u2))));
        const auto cube = hn::Set(di, static_cast<std::int32_t>(m[9]));
        at = hn::IfThenElse(mine, hn::Add(hn::Or(in_block, block), cube), at);
        left = hn::AndNot(mine, left);
        (m[9] == kParenchymaOffset ? b.parenchyma_met : b.fine_met) = true;
    }
    const auto word = hn::GatherOffset(di, reinterpret_cast<const std::int32_t*>(b.fine), at);
    return hn::IfThenElseZero(fine, hn::ShiftLeft<2>(hn::ShiftRight<24>(hn::ShiftLeft<24>(word))));
}

// Adds fine structure to the stretch's offsets. It has a loop of its own: the cubes together are as
// large as the second-level cache, and the look-ups of several rows must wait at the same time.
template <class D>
HWY_NOINLINE void fine_chunk(D d, PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const auto walk = beam_walk(d, b, c.beam, kVoxelOrigin, kVoxelPerMm, b.shift_voxel);
    for (int row = 0; row < c.rows; ++row) {
        std::int32_t* offset = c.structure.row(row);
        auto sum = fine_offset(d, b, c, walk.at(d, b, c.beam, c.first + row), row);
        if (c.offsets) sum = hn::Add(sum, hn::Load(di, offset));
        hn::Store(sum, di, offset);
    }
    c.offsets = true;
}

template <class D>
HWY_NOINLINE void scatter_chunk(D d, PhysicalBlock& b, const BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const auto per_log2 = hn::Set(d, static_cast<float>(1 / (16 * physical::kDbPerLog2)));
    for (int row = 0; row < c.rows; ++row) {
        const auto word = hn::Load(di, c.acoustics.row(row));
        auto echo = hn::ShiftRight<20>(word);  // 1/16 dB
        if (c.offsets) echo = hn::Add(echo, hn::Load(di, c.structure.row(row)));
        const auto solid = hn::Ne(hn::And(word, hn::Set(di, 7 << 16)), hn::Zero(di));
        const auto amplitude = hn::IfThenElseZero(
            hn::RebindMask(d, solid), exp2_near(d, hn::Mul(hn::ConvertTo(d, echo), per_log2)));
        const std::ptrdiff_t out = static_cast<std::ptrdiff_t>(c.first + row) * b.stride + c.beam;
        const auto write = [&](auto re, auto im, int field) HWY_ATTR {
            if (c.surfaces) {
                re = hn::Add(re, hn::Load(d, c.echo_re.row(row)));
                im = hn::Add(im, hn::Load(d, c.echo_im.row(row)));
            }
            hn::StoreU(pack_echo(d, re, im), di, b.echoes + field * b.look_stride + out);
        };
        const int looks = b.looks_at[c.first + row];
        if (!b.speckled) {
            for (int field = 0; field < looks; ++field) write(amplitude, hn::Zero(d), field);
            continue;
        }
        auto scatterers = scatterers_of_row(d, b, c.beam, c.first + row);
        const auto level = hn::Mul(amplitude, hn::Set(d, b.speckle_level[c.first + row]));
        for (int field = 0; field < looks; ++field) {
            hn::Vec<D> re, im;
            field_of_look(d, scatterers, field + 1 < looks, re, im);
            write(hn::Mul(re, level), hn::Mul(im, level), field);
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
