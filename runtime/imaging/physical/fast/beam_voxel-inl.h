// SPDX-License-Identifier: Apache-2.0

// Addresses of voxels in the brick table, for a vector of places.
#include "runtime/imaging/simd/simd_math-inl.h"
//
#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/brick_table.h"

#if defined(SONOCASE_BEAM_VOXEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_VOXEL_INL_H
#undef SONOCASE_BEAM_VOXEL_INL_H
#else
#define SONOCASE_BEAM_VOXEL_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

template <class DI>
struct VoxelAddress {
    hn::Vec<DI> brick;  // index of the brick's first table word; 0 outside the volume
    hn::Vec<DI> cell;   // voxel within the brick
    hn::Mask<DI> inside;
};

// i, j, l: voxel indices. b: what describes the table, a PhysicalBlock or a PhysicalRegion.
template <class DI, class Table>
HWY_INLINE VoxelAddress<DI> voxel_address(
    DI di, const Table& b, hn::Vec<DI> i, hn::Vec<DI> j, hn::Vec<DI> l) {
    const hn::RebindToUnsigned<DI> du;
    const auto below = [&](auto index, int size) HWY_ATTR {
        return hn::Lt(hn::BitCast(du, index), hn::Set(du, static_cast<std::uint32_t>(size)));
    };
    const auto inside = hn::RebindMask(
        di, hn::And(below(i, b.size.x), hn::And(below(j, b.size.y), below(l, b.size.z))));
    const int edge_log2 = b.block_log2;  // of a block of bricks
    const auto in_block = hn::Set(di, (1 << edge_log2) - 1), three = hn::Set(di, 3);
    const auto bi = hn::ShiftRight<2>(i), bj = hn::ShiftRight<2>(j), bl = hn::ShiftRight<2>(l);
    const auto along = [&](auto p) HWY_ATTR { return hn::ShiftRightSame(p, edge_log2); };
    const auto block = hn::Add(along(bi), hn::Add(hn::Mul(along(bj), hn::Set(di, b.blocks_x)),
                                                  hn::Mul(along(bl), hn::Set(di, b.blocks_xy))));
    // Base of the block, then the layer's, the row's and the brick's place in it.
    const auto shifted = [&](auto base, auto place)
                             HWY_ATTR { return hn::Or(hn::ShiftLeftSame(base, edge_log2), place); };
    const auto number =
        shifted(shifted(shifted(block, hn::And(bl, in_block)), hn::And(bj, in_block)),
                hn::And(bi, in_block));
    return {hn::ShiftLeft<2>(hn::IfThenElseZero(inside, number)),
            hn::Or(hn::And(i, three), hn::Or(hn::ShiftLeft<2>(hn::And(j, three)),
                                             hn::ShiftLeft<4>(hn::And(l, three)))),
            inside};
}

// Label of the voxel nearest to a place; 0, the outside, beyond the volume.
template <class D>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> nearest_label(
    D d, const PhysicalBlock& b, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) {
    const hn::RebindToSigned<D> di;
    const auto index = [&](auto p) HWY_ATTR {
        return hn::Sub(rounded_bits(d, p), hn::Set(di, kRoundingBits));
    };
    const auto at = voxel_address(di, b, index(x), index(y), index(z));
    const auto entry = hn::IfThenElse(at.inside, hn::GatherIndex(di, b.table, at.brick),
                                      hn::Set(di, static_cast<std::int32_t>(kUniformBrick)));
    const auto uniform = hn::Lt(entry, hn::Zero(di));
    auto label = entry;
    if (!hn::AllTrue(di, uniform)) {
        const auto voxel =
            hn::Or(hn::ShiftLeft<6>(hn::And(entry, hn::Set(di, 0x01FFFFFF))), at.cell);
        label = hn::IfThenElse(uniform, entry,
                               pool_byte(di, b.labels, hn::IfThenZeroElse(uniform, voxel)));
    }
    return hn::And(label, hn::Set(di, 0xFF));
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
