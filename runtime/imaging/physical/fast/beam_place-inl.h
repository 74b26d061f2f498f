// SPDX-License-Identifier: Apache-2.0

// Effects contact, deformation, breathing, elevation and slice: where the samples of a vector of
// beams lie, in voxels or in cells of scatterers, and the label of the voxel there. Included once
// per instruction set.
#include "runtime/imaging/core/simd_math-inl.h"
#include "runtime/imaging/physical/fast/beam_chunk.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/brick_table.h"

#if defined(SONOCASE_BEAM_PLACE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_PLACE_INL_H
#undef SONOCASE_BEAM_PLACE_INL_H
#else
#define SONOCASE_BEAM_PLACE_INL_H
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

// Places along a vector of beams: origin + s * per_mm, where s counts from the probe's face and the
// gap to the skin is closed; then to where pressed tissue lies at rest; less the breathing shift.
template <class D>
struct BeamWalk {
    hn::Vec<D> ox, oy, oz, vx, vy, vz, gap;
    const float* shift;     // of breathing at weight 1
    const float* sideways;  // row of numbers per mm beside the beam

    HWY_INLINE BeamPoint<D> at(D d, const PhysicalBlock& b, int beam, int k) const {
        auto s = hn::Add(hn::Set(d, b.r[k]), hn::Mul(gap, hn::Set(d, b.contact[k])));
        if (b.press != nullptr) s = hn::Add(s, hn::Load(d, b.press->along_row(k) + beam));
        if (b.dome_mm != nullptr) {  // physical::mirrored_mm()
            const auto behind =
                hn::Min(hn::Sub(hn::LoadU(d, b.dome_mm + beam), hn::Set(d, b.r[k])), hn::Zero(d));
            s = hn::Add(s, hn::Add(behind, behind));
        }
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

// beam: first beam of the vector. origin, per_mm: rows of the block's numbers per beam.
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

template <class DI>
struct VoxelAddress {
    hn::Vec<DI> brick;  // index of the brick's first table word; 0 outside the volume
    hn::Vec<DI> cell;   // voxel within the brick
    hn::Mask<DI> inside;
};

// Address of the voxel (i, j, l). b: PhysicalBlock or PhysicalRegion, which describes the table.
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

// Prefetches the lines that a later stage will read. A jumping probe finds nothing in the cache,
// and a look-up that waits holds up all that follow.
template <class T>
HWY_INLINE void fetch_lanes(const T* pool, const std::int32_t* at, int lanes) {
    for (int lane = 0; lane < lanes; ++lane) hwy::Prefetch(pool + at[lane]);
}

// Where each sample of a stretch lies in the slab, and the voxel that is looked up for it.
template <class D>
HWY_NOINLINE void place_chunk(D d, const PhysicalBlock& block, BeamChunk& c) {
    const PhysicalBlock b = block;
    const hn::RebindToSigned<D> di;
    const int v = c.beam;
    const auto beam = [&](int number)
                          HWY_ATTR { return hn::LoadU(d, b.beams + number * b.lines + v); };
    const auto walk = beam_walk(d, b, v, kVoxelOrigin, kVoxelPerMm, b.shift_voxel);
    const auto jitter = hn::Set(d, static_cast<float>(physical::kLookupJitter) / 32);
    const auto jx = hn::Mul(beam(kBeam), jitter), jy = hn::Mul(beam(kBeam + 1), jitter),
               jz = hn::Mul(beam(kBeam + 2), jitter);
    const auto shift = hn::Set(d, kRoundingShift);
    const auto bits = hn::Set(di, kRoundingBits);
    for (int row = 0; row < c.rows; ++row) {
        const int k = c.first + row;
        auto [px, py, pz] = walk.at(d, b, v, k);
        // The slab's sample, and the voxel that is looked up: a random step away.
        const auto j1 = noise_of(d, b.white + b.elevation_start[k] + v);
        const auto j2 = noise_of(d, b.white + b.lookup_start[k] + v);
        const auto e = hn::Mul(j1, hn::Set(d, b.elevation[k]));
        px = hn::Add(px, hn::Mul(e, hn::Set(d, b.across[0])));
        py = hn::Add(py, hn::Mul(e, hn::Set(d, b.across[1])));
        pz = hn::Add(pz, hn::Mul(e, hn::Set(d, b.across[2])));
        // Nearest voxel: its centre as a number, then its index.
        const auto centre = [&](auto p, int axis, auto j) HWY_ATTR {
            const auto asked =
                hn::Add(p, hn::Add(hn::Mul(j2, hn::Set(d, b.sideways[axis])), hn::Mul(j1, j)));
            return hn::Add(asked, shift);
        };
        const auto hx = centre(px, 0, jx), hy = centre(py, 1, jy), hz = centre(pz, 2, jz);
        const auto i = hn::Sub(hn::BitCast(di, hx), bits), j = hn::Sub(hn::BitCast(di, hy), bits),
                   l = hn::Sub(hn::BitCast(di, hz), bits);
        const auto at = voxel_address(di, b, i, j, l);
        hn::Store(px, d, c.x.row(row));
        hn::Store(py, d, c.y.row(row));
        hn::Store(pz, d, c.z.row(row));
        hn::Store(hn::Sub(px, hn::Sub(hx, shift)), d, c.off_x.row(row));
        hn::Store(hn::Sub(py, hn::Sub(hy, shift)), d, c.off_y.row(row));
        hn::Store(hn::Sub(pz, hn::Sub(hz, shift)), d, c.off_z.row(row));
        hn::Store(hn::IfThenElse(at.inside, at.cell, hn::Set(di, -1)), di, c.cell.row(row));
        hn::Store(at.brick, di, c.brick.row(row));
        fetch_lanes(b.table, c.brick.row(row), static_cast<int>(hn::Lanes(d)));
    }
}

// Reads the words of each sample's brick, and the index of its voxel in the pools.
template <class D>
HWY_NOINLINE void entry_chunk(D d, const PhysicalBlock& block, BeamChunk& c) {
    const PhysicalBlock b = block;
    const hn::RebindToSigned<D> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(di);
    const auto nothing = hn::Set(di, static_cast<std::int32_t>(kUniformBrick));
    const auto index = hn::Set(di, 0x01FFFFFF);
    const auto flag = hn::Set(di, static_cast<std::int32_t>(kBoundaryFlag));
    c.pooled = c.echo_pooled = c.bounded = false;
    for (int row = 0; row < c.rows; ++row) {
        const auto brick = hn::Load(di, c.brick.row(row)), cell = hn::Load(di, c.cell.row(row));
        const auto inside = hn::Gt(cell, hn::Set(di, -1));
        const auto entry = hn::IfThenElse(inside, hn::GatherIndex(di, b.table, brick), nothing);
        hn::Store(entry, di, c.entry.row(row));
        const auto uniform = hn::Lt(entry, zero);
        if (!hn::AllTrue(di, uniform)) {
            c.pooled = true;
            const auto at = hn::Or(hn::ShiftLeft<6>(hn::And(entry, index)), cell);
            hn::Store(hn::IfThenZeroElse(uniform, at), di, c.label.row(row));
            fetch_lanes(reinterpret_cast<const std::uint8_t*>(b.labels), c.label.row(row), lanes);
        } else {
            hn::Store(zero, di, c.label.row(row));
        }
        if (b.structure) {
            const auto word =
                hn::IfThenElse(inside, hn::GatherIndex(di, b.table + 1, brick), nothing);
            const auto at = hn::Or(hn::ShiftLeft<6>(word), cell);
            const auto alike = hn::Lt(word, zero);
            c.echo_pooled = c.echo_pooled || !hn::AllTrue(di, alike);
            hn::Store(word, di, c.echo_word.row(row));
            hn::Store(hn::IfThenZeroElse(alike, at), di, c.structure.row(row));
            fetch_lanes(reinterpret_cast<const std::int8_t*>(b.echo), c.structure.row(row), lanes);
        }
        const auto bounded = hn::TestBit(entry, flag);
        if (b.boundary != nullptr && !hn::AllFalse(di, bounded)) {
            c.bounded = true;
            const auto base = hn::GatherIndex(di, b.table + 2, brick);
            const auto at = hn::Or(hn::ShiftLeft<6>(base), cell);
            hn::Store(hn::IfThenElseZero(bounded, at), di, c.record.row(row));
            fetch_lanes(b.boundary, c.record.row(row), lanes);
        } else {
            hn::Store(zero, di, c.record.row(row));
        }
    }
}

template <class D>
HWY_NOINLINE void label_chunk(D, const PhysicalBlock& b, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    const auto byte = hn::Set(di, 0xFF);
    for (int row = 0; row < c.rows; ++row) {
        const auto entry = hn::Load(di, c.entry.row(row));
        auto label = entry;
        if (c.pooled) {
            const auto voxel = pool_byte(di, b.labels, hn::Load(di, c.label.row(row)));
            label = hn::IfThenElse(hn::Lt(entry, hn::Zero(di)), entry, voxel);
        }
        hn::Store(hn::And(label, byte), di, c.label.row(row));
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
