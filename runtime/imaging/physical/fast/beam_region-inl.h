// SPDX-License-Identifier: Apache-2.0

// The fine region (model/region_look_up.h): samples in its box take labels and records from its
// smaller voxels, before surfaces are worked out.
#include "runtime/imaging/core/simd_math-inl.h"
#include "runtime/imaging/physical/fast/beam_place-inl.h"
//
#include "formats/volume/boundary_record.h"
#include "runtime/imaging/physical/fast/beam_chunk.h"

#if defined(SONOCASE_BEAM_REGION_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_REGION_INL_H
#undef SONOCASE_BEAM_REGION_INL_H
#else
#define SONOCASE_BEAM_REGION_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// Lanes of a row in whose bricks the region may hold something else.
template <class D>
HWY_INLINE hn::Mask<hn::RebindToSigned<D>> is_marked(D, const BeamChunk& c, int row) {
    const hn::RebindToSigned<D> di;
    return hn::TestBit(hn::Load(di, c.entry.row(row)),
                       hn::Set(di, static_cast<std::int32_t>(kRegionFlag)));
}

// Lanes of a row whose point lies in the box.
template <class D>
HWY_INLINE hn::Mask<D> in_region(D d, const PhysicalRegion& g, const BeamChunk& c, int row) {
    const auto between = [&](const float* p, int axis) HWY_ATTR {
        const auto at = hn::Load(d, p);
        return hn::And(hn::Ge(at, hn::Set(d, g.lower[axis])),
                       hn::Lt(at, hn::Set(d, g.upper[axis])));
    };
    return hn::And(between(c.x.row(row), 0),
                   hn::And(between(c.y.row(row), 1), between(c.z.row(row), 2)));
}

// The voxels of the region for a row. They are looked up at the random step of the case's look-up,
// as many voxels wide.
template <class D>
struct RegionRow {
    hn::Vec<D> place[3], centre[3];  // voxels of the region; centre with kRoundingShift
    VoxelAddress<hn::RebindToSigned<D>> at;
    hn::Mask<hn::RebindToSigned<D>> use;   // lanes that take something from the region
    hn::Vec<hn::RebindToSigned<D>> entry;  // the brick's label word
};

template <class D>
HWY_INLINE RegionRow<D> region_row(D d,
                                   const PhysicalBlock& b,
                                   const PhysicalRegion& g,
                                   const BeamChunk& c,
                                   int row,
                                   hn::Mask<hn::RebindToSigned<D>> here) {
    const hn::RebindToSigned<D> di;
    const int v = c.beam, k = c.first + row;
    const auto j1 = noise_of(d, b.white + b.elevation_start[k] + v);
    const auto j2 = noise_of(d, b.white + b.lookup_start[k] + v);
    const auto along = hn::Mul(j1, hn::Set(d, static_cast<float>(physical::kLookupJitter) / 32));
    const auto bits = hn::Set(di, kRoundingBits);
    const float* place[3] = {c.x.row(row), c.y.row(row), c.z.row(row)};
    RegionRow<D> r;
    hn::Vec<hn::RebindToSigned<D>> index[3];
    for (int axis = 0; axis < 3; ++axis) {
        r.place[axis] = hn::Add(hn::Mul(hn::Load(d, place[axis]), hn::Set(d, g.per_voxel)),
                                hn::Set(d, g.first[axis]));
        const auto beam = hn::LoadU(d, b.beams + (kBeam + axis) * b.lines + v);
        const auto step = hn::Add(hn::Mul(j2, hn::Set(d, b.sideways[axis])), hn::Mul(along, beam));
        r.centre[axis] = hn::Add(hn::Add(r.place[axis], step), hn::Set(d, kRoundingShift));
        index[axis] = hn::Sub(hn::BitCast(di, r.centre[axis]), bits);
    }
    r.at = voxel_address(di, g, index[0], index[1], index[2]);
    r.use = hn::And(here, r.at.inside);
    return r;
}

// Label and record (kNoBoundary: none) of a row's voxels.
template <class D>
HWY_INLINE auto region_label(D, const PhysicalRegion& g, const RegionRow<D>& r) {
    const hn::RebindToSigned<D> di;
    const auto uniform = hn::Lt(r.entry, hn::Zero(di));
    auto label = r.entry;
    if (!hn::AllTrue(di, uniform)) {
        const auto voxel =
            hn::Or(hn::ShiftLeft<6>(hn::And(r.entry, hn::Set(di, 0x01FFFFFF))), r.at.cell);
        label = hn::IfThenElse(uniform, r.entry,
                               pool_byte(di, g.labels, hn::IfThenZeroElse(uniform, voxel)));
    }
    return hn::And(label, hn::Set(di, 0xFF));
}

template <class D>
HWY_INLINE auto region_record(D,
                              const PhysicalBlock& b,
                              const PhysicalRegion& g,
                              const RegionRow<D>& r,
                              hn::Mask<hn::RebindToSigned<D>> bounded) {
    const hn::RebindToSigned<D> di;
    const auto none = hn::Set(di, static_cast<std::int32_t>(kNoBoundary));
    if (b.boundary == nullptr || g.boundary == nullptr || hn::AllFalse(di, bounded)) return none;
    const auto base = hn::GatherIndex(di, g.table + 2, r.at.brick);
    const auto voxel = hn::IfThenElseZero(bounded, hn::Or(hn::ShiftLeft<6>(base), r.at.cell));
    return hn::IfThenElse(bounded, hn::GatherIndex(di, g.boundary, voxel), none);
}

// Takes over a row where some voxels of the region hold a surface, or another label than the case.
template <class D>
HWY_INLINE void take_from_region(D d,
                                 const PhysicalBlock& b,
                                 const PhysicalRegion& g,
                                 const RegionRow<D>& r,
                                 hn::Mask<hn::RebindToSigned<D>> bounded,
                                 BeamChunk& c,
                                 int row) {
    const hn::RebindToSigned<D> di;
    const auto none = hn::Set(di, static_cast<std::int32_t>(kNoBoundary));
    const auto reach = hn::Set(di, static_cast<std::int32_t>(48 * physical::kSurfaceReachVx) + 1);
    const auto label = region_label(d, g, r), record = region_record(d, b, g, r, bounded);
    const auto own = hn::Load(di, c.label.row(row)), own_record = hn::Load(di, c.record.row(row));
    const auto steps = hn::ShiftRight<24>(hn::ShiftLeft<16>(record));
    const auto near = hn::And(
        r.use, hn::And(hn::Lt(hn::And(record, hn::Set(di, 0xFF)), hn::Set(di, b.label_count)),
                       hn::Lt(hn::Abs(steps), reach)));
    const auto near_f = hn::RebindMask(d, near);
    const auto keeps = hn::Or(hn::Not(r.use), hn::Eq(own, label));
    hn::Store(hn::IfThenElse(near, record, hn::IfThenElse(keeps, own_record, none)), di,
              c.record.row(row));
    hn::Store(hn::IfThenElse(r.use, label, own), di, c.label.row(row));
    if (hn::AllFalse(di, near)) return;
    hn::Store(hn::IfThenElse(near_f, hn::Set(d, -1e9f), hn::Load(d, c.min_mm.row(row))), d,
              c.min_mm.row(row));
    hn::Store(hn::IfThenElse(near_f, hn::Set(d, g.step_mm), hn::Load(d, c.step_mm.row(row))), d,
              c.step_mm.row(row));
    float* off[3] = {c.off_x.row(row), c.off_y.row(row), c.off_z.row(row)};
    for (int axis = 0; axis < 3; ++axis) {
        const auto centre = hn::Sub(r.centre[axis], hn::Set(d, kRoundingShift));
        const auto fine = hn::Mul(hn::Sub(r.place[axis], centre), hn::Set(d, g.voxel_size));
        hn::Store(hn::IfThenElse(near_f, fine, hn::Load(d, off[axis])), d, off[axis]);
    }
}

// Comes after record_chunk() and before surface_chunk(). True: the stretch meets the region, and
// records are filled in for all its samples. Otherwise it costs a test of each brick's word.
template <class D>
HWY_NOINLINE bool region_chunk(D d, const PhysicalBlock& b, const PhysicalRegion& g, BeamChunk& c) {
    const hn::RebindToSigned<D> di;
    bool any = false, surfaces = false;
    for (int row = 0; row < c.rows && !any; ++row) any = !hn::AllFalse(di, is_marked(d, c, row));
    if (!any) return false;
    const auto none = hn::Set(di, static_cast<std::int32_t>(kNoBoundary));
    const auto flag = hn::Set(di, static_cast<std::int32_t>(kBoundaryFlag));
    const auto case_step = hn::Set(d, b.voxel_mm / 48);
    // Each loop prefetches what the next one reads.
    const int lanes = static_cast<int>(hn::Lanes(d));
    RegionRow<D> rows[kChunkRows];
    bool takes[kChunkRows] = {};
    HWY_ALIGN std::int32_t lines[kBeamBlock];
    for (int row = 0; row < c.rows; ++row) {
        hn::Store(case_step, d, c.step_mm.row(row));
        hn::Store(hn::Set(d, -1e9f), d, c.min_mm.row(row));
        if (!c.bounded) hn::Store(none, di, c.record.row(row));
        const auto marked = is_marked(d, c, row);
        if (hn::AllFalse(di, marked)) continue;
        const auto here = hn::And(hn::RebindMask(di, in_region(d, g, c, row)), marked);
        if (hn::AllFalse(di, here)) continue;
        rows[row] = region_row(d, b, g, c, row, here);
        takes[row] = true;
        hn::Store(rows[row].at.brick, di, lines);
        fetch_lanes(g.table, lines, lanes);
    }
    for (int row = 0; row < c.rows; ++row) {
        if (!takes[row]) continue;
        RegionRow<D>& r = rows[row];
        r.entry = hn::IfThenElse(r.use, hn::GatherIndex(di, g.table, r.at.brick),
                                 hn::Set(di, static_cast<std::int32_t>(kUniformBrick)));
        // Where the region's voxel holds no surface, the case's surface must not be passed.
        hn::Store(hn::IfThenElse(hn::RebindMask(d, r.use), hn::Zero(d), hn::Set(d, -1e9f)), d,
                  c.min_mm.row(row));
        const auto bounded = hn::And(r.use, hn::TestBit(r.entry, flag));
        const auto same =
            hn::And(hn::Lt(r.entry, hn::Zero(di)),
                    hn::Eq(hn::And(r.entry, hn::Set(di, 0xFF)), hn::Load(di, c.label.row(row))));
        takes[row] = !hn::AllFalse(di, hn::Or(bounded, hn::AndNot(same, r.use)));
        if (hn::AllFalse(di, bounded) || g.boundary == nullptr) continue;
        const auto base = hn::GatherIndex(di, g.table + 2, r.at.brick);
        hn::Store(hn::IfThenElseZero(bounded, hn::Or(hn::ShiftLeft<6>(base), r.at.cell)), di,
                  lines);
        fetch_lanes(g.boundary, lines, lanes);
    }
    for (int row = 0; row < c.rows; ++row) {
        if (!takes[row]) continue;
        const auto bounded = hn::And(rows[row].use, hn::TestBit(rows[row].entry, flag));
        take_from_region(d, b, g, rows[row], bounded, c, row);
        surfaces = surfaces || !hn::AllFalse(di, bounded);
    }
    c.bounded = c.bounded || (surfaces && b.boundary != nullptr);
    return true;
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
