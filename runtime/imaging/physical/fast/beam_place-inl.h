// SPDX-License-Identifier: Apache-2.0

// Effects elevation and slice: where in the slab each sample of a stretch lies, and the label of
// the voxel there.
#include "runtime/imaging/physical/fast/beam_voxel-inl.h"
#include "runtime/imaging/physical/fast/beam_walk-inl.h"
//
#include "runtime/imaging/physical/fast/beam_chunk.h"

#if defined(SONOCASE_BEAM_PLACE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_PLACE_INL_H
#undef SONOCASE_BEAM_PLACE_INL_H
#else
#define SONOCASE_BEAM_PLACE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// A jumping probe finds nothing in the cache, and a look-up that waits holds up all that follow:
// each stage prefetches the lines that a later one will read.
template <class T>
HWY_INLINE void fetch_lanes(const T* pool, const std::int32_t* at, int lanes) {
    for (int lane = 0; lane < lanes; ++lane) hwy::Prefetch(pool + at[lane]);
}

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

// The words of each sample's brick, and the index of its voxel in the pools.
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
