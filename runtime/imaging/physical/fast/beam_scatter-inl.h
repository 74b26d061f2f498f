// SPDX-License-Identifier: Apache-2.0

// Effects structure, fine_structure and speckle: the scatterers of a stretch, with the echoes of
// its surfaces.
#include "runtime/imaging/physical/fast/beam_speckle-inl.h"
//
#include "runtime/imaging/physical/fast/beam_chunk.h"

#if defined(SONOCASE_BEAM_SCATTER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_SCATTER_INL_H
#undef SONOCASE_BEAM_SCATTER_INL_H
#else
#define SONOCASE_BEAM_SCATTER_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// Acoustic properties of the labels; in most places all beams are in one.
template <class D>
HWY_NOINLINE void look_chunk(D, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const std::int32_t first = c.label.row(0)[0];
    auto other = hn::Zero(di);
    for (int row = 0; row < c.rows; ++row)
        other = hn::Or(other, hn::Xor(hn::Load(di, c.label.row(row)), hn::Set(di, first)));
    c.one_label = hn::AllTrue(di, hn::Eq(other, hn::Zero(di)));
    const auto kind_bits = hn::Set(di, 7 << 16);
    auto hardest = hn::Zero(di), any = hn::Zero(di);
    for (int row = 0; row < c.rows; ++row) {
        auto look = hn::Set(di, b.looks[first]);
        if (!c.one_label) look = hn::GatherIndex(di, b.looks, hn::Load(di, c.label.row(row)));
        hardest = hn::Max(hardest, hn::And(look, kind_bits));
        any = hn::Or(any, look);
        hn::Store(look, di, c.look.row(row));
    }
    c.fine = !hn::AllFalse(di, hn::TestBit(any, hn::Set(di, kLookFine)));
    c.hard =
        !hn::AllTrue(di, hn::Lt(hardest, hn::Set(di, static_cast<std::int32_t>(kPackedGas) << 16)));
}

// Baked echo offsets.
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
        if (b.structure_most != nullptr)
            sixteenths = hn::Min(sixteenths, hn::GatherIndex(di, b.structure_most, label));
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

// Fibres, septa and parenchyma, 1/16 dB. Label by label (mostly a single one), so that no lane
// depends on its neighbours.
template <class D>
HWY_INLINE auto fine_offset(
    D d, PhysicalBlock& b, const BeamChunk& c, const BeamPoint<D>& place, int row) {
    static_assert(physical::kFineEdge == 64);
    const hn::RebindToSigned<D> di;
    const auto fine = hn::TestBit(hn::Load(di, c.look.row(row)), hn::Set(di, kLookFine));
    auto left = fine;
    auto at = hn::Zero(di);
    const std::int32_t* labels = c.label.row(row);
    while (!hn::AllFalse(di, left)) {
        const std::int32_t label = labels[hn::FindFirstTrue(di, left)];
        const auto mine = hn::And(left, hn::Eq(hn::Load(di, labels), hn::Set(di, label)));
        const float* m = b.fine_frames + kFineNumbers * label;
        const auto coordinate = [&](int r, std::int32_t most) HWY_ATTR {
            const auto term = [&](auto p, int axis)
                                  HWY_ATTR { return hn::Mul(p, hn::Set(d, m[3 * r + axis])); };
            const auto u = hn::Add(hn::Add(term(place.x, 0), term(place.y, 1)), term(place.z, 2));
            return hn::And(rounded_bits(d, u), hn::Set(di, most));
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

// Added to the stretch's offsets. A loop of its own: the cubes together are as large as the
// second-level cache, and the look-ups of several rows must wait at the same time.
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
        const auto look = hn::Load(di, c.look.row(row));
        auto echo = hn::ShiftRight<20>(look);  // 1/16 dB
        if (c.offsets) echo = hn::Add(echo, hn::Load(di, c.structure.row(row)));
        const auto solid = hn::Ne(hn::And(look, hn::Set(di, 7 << 16)), hn::Zero(di));
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
