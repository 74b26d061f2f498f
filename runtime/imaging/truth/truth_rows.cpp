// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_rows.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cstddef>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "truth_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/core/simd_math-inl.h"
#include "runtime/imaging/press/press_view-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kMaxLanes = 64;  // of any instruction set that the kernels are compiled for

template <class D>
using IntOf = hn::Vec<hn::RebindToSigned<D>>;

// Three coordinates of a vector of points.
template <class D>
struct Places {
    hn::Vec<D> x, y, z;
};

template <class D>
HWY_INLINE IntOf<D> rays_of(D, const TruthRun& run, int first) {
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::uint16_t, D> d16;
    return hn::PromoteTo(di, hn::LoadU(d16, run.ray + first));
}

// Numbers of a vector of rays, # rays in all. Rays ascend along a run, mostly one per pixel: those
// of a vector of pixels lie in two vectors of the table, and gathering takes several times as long.
// Lanes past the run's end hold any number.
template <class D>
class RayNumbers {
  public:
    HWY_INLINE RayNumbers(D d, const TruthRun& run, int first, int used, int rays)
        : ray_(rays_of(d, run, first)) {
        const hn::RebindToSigned<D> di;
        const int lanes = static_cast<int>(hn::Lanes(d));
        const int lowest = run.ray[first];
        gathers_ = run.ray[first + used - 1] - lowest >= 2 * lanes || rays < 2 * lanes;
        if (gathers_) return;
        from_ = std::min(lowest, rays - 2 * lanes);
        ray_ = hn::Min(hn::Max(hn::Sub(ray_, hn::Set(di, from_)), hn::Zero(di)),
                       hn::Set(di, 2 * lanes - 1));
    }
    HWY_INLINE hn::Vec<D> of(D d, const float* table) const {
        if (gathers_) return hn::GatherIndex(d, table, ray_);
        const hn::RebindToSigned<D> di;
        const int lanes = static_cast<int>(hn::Lanes(d));
        const auto upper = hn::Gt(ray_, hn::Set(di, lanes - 1));
        const auto width = hn::IfThenElseZero(upper, hn::Set(di, lanes));
        const auto index = hn::IndicesFromVec(d, hn::Sub(ray_, width));
        return hn::IfThenElse(hn::RebindMask(d, upper),
                              hn::TableLookupLanes(hn::LoadU(d, table + from_ + lanes), index),
                              hn::TableLookupLanes(hn::LoadU(d, table + from_), index));
    }

  private:
    IntOf<D> ray_;  // of the table, or of the two vectors from from_ on
    int from_ = 0;
    bool gathers_ = false;
};

// Contact: moves each point along its beam by gap exp(-r / reach).
template <class D, class V>
HWY_INLINE void close_gap(D d,
                          const TruthFrameRows& f,
                          const TruthRun& run,
                          int first,
                          int used,
                          V column,
                          V& air,
                          Places<D>& p) {
    const auto r = hn::LoadU(d, run.r_mm + first);
    const auto gap = RayNumbers<D>(d, run, first, used, f.rays).of(d, f.gap_mm);
    air = hn::Min(gap, hn::Zero(d));                        // below 0: air
    if (hn::AllFalse(d, hn::Gt(gap, hn::Zero(d)))) return;  // nothing moves
    const auto shift =
        hn::Mul(hn::Max(gap, hn::Zero(d)), exp2_fading(d, hn::Mul(r, hn::Set(d, -f.per_reach))));
    auto along_x = hn::Zero(d), along_z = shift;
    if (f.fan) {
        const auto away = hn::Max(hn::Add(r, hn::Set(d, f.radius_mm)), hn::Set(d, 1e-3f));
        const auto part = hn::Div(shift, away);
        const float z_mm =
            (static_cast<float>(run.row) - f.origin_y_px) * f.mm_per_px + f.radius_mm;
        along_x = hn::Mul(
            part, hn::Mul(hn::Sub(column, hn::Set(d, f.origin_x_px)), hn::Set(d, f.mm_per_px)));
        along_z = hn::Mul(part, hn::Set(d, z_mm));
    }
    const auto moved = [&](V v, int axis) HWY_ATTR {
        return hn::Add(v, hn::Add(hn::Mul(along_x, hn::Set(d, f.beam_x[axis])),
                                  hn::Mul(along_z, hn::Set(d, f.beam_z[axis]))));
    };
    p = {moved(p.x, 0), moved(p.y, 1), moved(p.z, 2)};
}

// Pressing: moves each point back to where its tissue lies at rest. closed: 1 in a closed lumen.
template <class D, class V, class I>
HWY_NOINLINE void press_back(D d,
                             const TruthFrameRows& f,
                             const TruthRun& run,
                             int first,
                             V column,
                             Places<D>& p,
                             I& closed) {
    namespace lanes = press::HWY_NAMESPACE;
    const hn::RebindToSigned<D> di;
    const auto r = hn::LoadU(d, run.r_mm + first);
    const auto half = hn::Set(d, 0.5f);
    const auto ray = hn::Add(hn::ConvertTo(d, rays_of(d, run, first)), half);
    const auto x = hn::Mul(hn::Sub(column, hn::Set(d, f.origin_x_px)), hn::Set(d, f.mm_per_px));
    const auto z = hn::Set(d, (static_cast<float>(run.row) - f.origin_y_px) * f.mm_per_px);
    auto dx = hn::Zero(d), dz = hn::Set(d, 1.0f);
    if (f.fan) {
        const auto radius = hn::Set(d, f.radius_mm);
        const auto away = hn::Max(hn::Add(r, radius), hn::Set(d, 1e-3f));
        dx = hn::Div(x, away);
        dz = hn::Div(hn::Add(z, radius), away);
    }
    const auto line = hn::Sub(hn::Mul(ray, hn::Set(d, f.lines_per_ray)), half);
    const lanes::PlaceLanes<D> place{x, z, dx, dz, line, r};
    const lanes::ShiftLanes<D> shift = lanes::shift_lanes(d, *f.press, place);
    const auto move_x = hn::Add(hn::Mul(shift.along, dx), hn::Mul(shift.side, dz));
    const auto move_z = hn::Sub(hn::Mul(shift.along, dz), hn::Mul(shift.side, dx));
    const auto moved = [&](V v, int axis) HWY_ATTR {
        return hn::Add(v, hn::Add(hn::Mul(move_x, hn::Set(d, f.beam_x[axis])),
                                  hn::Mul(move_z, hn::Set(d, f.beam_z[axis]))));
    };
    p = {moved(p.x, 0), moved(p.y, 1), moved(p.z, 2)};
    closed = hn::Zero(di);
    if (f.press->pressed && f.press->field->closed_nodes().any)
        closed = lanes::closed_lanes(d, *f.press, place, shift);
}

// Breathing: moves each point back by the shift times the weight, trilinear in its lattice, whose
// rim holds 0.
template <class D>
HWY_INLINE void breathe_back(D d, const TruthFrameRows& f, Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using V = hn::Vec<D>;
    const V one = hn::Set(d, 1.0f);
    // Cell of the lattice along an axis, and the shares of its ends.
    const auto along = [&](V voxel, int a, V& near, V& far) HWY_ATTR {
        const V at = hn::Mul(hn::Sub(voxel, hn::Set(d, f.first_vx[a])), hn::Set(d, f.per_voxel));
        const V last = hn::Set(d, static_cast<float>(f.lattice[a] - 1));
        const V bounded = hn::Min(hn::Max(at, hn::Zero(d)), last);
        const V low = hn::Min(hn::Floor(bounded), hn::Sub(last, one));
        far = hn::Sub(bounded, low);
        near = hn::Sub(one, far);
        return hn::ConvertTo(di, low);
    };
    V x0, x1, y0, y1, z0, z1;
    const auto i = along(p.x, 0, x0, x1), j = along(p.y, 1, y0, y1), k = along(p.z, 2, z0, z1);
    const std::ptrdiff_t row = f.lattice[0], plane = row * f.lattice[1];
    const auto rows = hn::Add(hn::Mul(k, hn::Set(di, f.lattice[1])), j);
    const auto index = hn::Add(hn::Mul(rows, hn::Set(di, f.lattice[0])), i);
    // A vector of pixels meets few cells, mostly one: spreading the corners of each over its lanes
    // takes less time than gathering them.
    const std::int32_t cell = hn::GetLane(index);
    const float* first = f.weight + cell;
    V c000 = hn::Set(d, first[0]), c001 = hn::Set(d, first[1]);
    V c010 = hn::Set(d, first[row]), c011 = hn::Set(d, first[row + 1]);
    V c100 = hn::Set(d, first[plane]), c101 = hn::Set(d, first[plane + 1]);
    V c110 = hn::Set(d, first[plane + row]), c111 = hn::Set(d, first[plane + row + 1]);
    auto left = hn::Ne(index, hn::Set(di, cell));
    if (!hn::AllFalse(di, left)) {
        HWY_ALIGN std::int32_t cells[kMaxLanes];
        hn::Store(index, di, cells);
        do {
            const std::int32_t here = cells[hn::FindKnownFirstTrue(di, left)];
            const auto same = hn::Eq(index, hn::Set(di, here));
            const auto lanes = hn::RebindMask(d, same);
            const float* from = f.weight + here;
            const auto spread = [&](V& corner, const float* weight) HWY_ATTR {
                corner = hn::IfThenElse(lanes, hn::Set(d, *weight), corner);
            };
            spread(c000, from), spread(c001, from + 1);
            spread(c010, from + row), spread(c011, from + row + 1);
            spread(c100, from + plane), spread(c101, from + plane + 1);
            spread(c110, from + plane + row), spread(c111, from + plane + row + 1);
            left = hn::AndNot(same, left);
        } while (!hn::AllFalse(di, left));
    }
    V sum = hn::Zero(d);
    const auto add = [&](V share, V low, V high) HWY_ATTR {
        sum = hn::Add(sum, hn::Mul(hn::Mul(share, x0), low));
        sum = hn::Add(sum, hn::Mul(hn::Mul(share, x1), high));
    };
    add(hn::Mul(z0, y0), c000, c001), add(hn::Mul(z0, y1), c010, c011);
    add(hn::Mul(z1, y0), c100, c101), add(hn::Mul(z1, y1), c110, c111);
    p.x = hn::Sub(p.x, hn::Mul(sum, hn::Set(d, f.shift_vx[0])));
    p.y = hn::Sub(p.y, hn::Mul(sum, hn::Set(d, f.shift_vx[1])));
    p.z = hn::Sub(p.z, hn::Mul(sum, hn::Set(d, f.shift_vx[2])));
}

// The label on that side of the voxel's surface on which each point lies. off: the point relative
// to the voxel's centre.
template <class D, class I>
HWY_INLINE I side_of_surface(D d, const TruthFrameRows& f, I record, I own, const Places<D>& off) {
    const hn::RebindToSigned<D> di;
    const auto second = hn::And(record, hn::Set(di, 0xFF));
    const auto near = hn::Lt(second, hn::Set(di, f.label_count));
    if (hn::AllFalse(di, near)) return own;
    const auto [nu, nv, nz] = octahedral_normal(d, record);
    const auto square = hn::Add(hn::Add(hn::Mul(nu, nu), hn::Mul(nv, nv)), hn::Mul(nz, nz));
    const auto along = hn::Add(hn::Mul(nu, off.x), hn::Add(hn::Mul(nv, off.y), hn::Mul(nz, off.z)));
    auto side = hn::Add(hn::Mul(signed_byte<1>(d, record), hn::Set(d, 1.0f / 48)),
                        hn::Div(along, hn::Sqrt(square)));
    // Walls of vessels move outwards, seen from both sides of them.
    if (f.pulse_vx != 0 || f.vein_vx != 0) {
        const auto first = hn::GatherIndex(di, f.labels, own);
        const auto other = hn::GatherIndex(di, f.labels, second);
        const auto wall = [&](std::int32_t bit, float shift_vx) HWY_ATTR {
            const auto is = [&](I label) HWY_ATTR {
                return hn::RebindMask(d, hn::Ne(hn::And(label, hn::Set(di, bit)), hn::Zero(di)));
            };
            const auto shift = hn::Set(d, shift_vx);
            const auto inside = is(first), beside = hn::AndNot(inside, is(other));
            side = hn::Add(side, hn::IfThenElseZero(inside, shift));
            side = hn::Sub(side, hn::IfThenElseZero(beside, shift));
        };
        if (f.pulse_vx != 0) wall(kArtery, f.pulse_vx);
        if (f.vein_vx != 0) wall(kVein, f.vein_vx);
    }
    const auto beyond = hn::And(near, hn::RebindMask(di, hn::Lt(side, hn::Zero(d))));
    return hn::IfThenElse(beyond, second, own);
}

// The voxels nearest to points: brick and cell in it, and the points relative to the voxels'
// centres.
template <class D>
struct Voxels {
    IntOf<D> brick, cell;
    Places<D> off;
};
template <class D>
HWY_INLINE Voxels<D> voxels_of(D d, const TruthFrameRows& f, const Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using I = IntOf<D>;
    // TruthRenderer draws no frame so far away that this is not exact.
    const auto shift = hn::Set(d, kRoundingShift);
    const auto bits = hn::Set(di, kRoundingBits);
    const auto hx = hn::Add(p.x, shift), hy = hn::Add(p.y, shift), hz = hn::Add(p.z, shift);
    const I i = hn::Sub(hn::BitCast(di, hx), bits), j = hn::Sub(hn::BitCast(di, hy), bits),
            k = hn::Sub(hn::BitCast(di, hz), bits);
    // An index is inside where neither it nor what is left to the last one is negative.
    const auto beyond = [&](I v, int axis) HWY_ATTR {
        return hn::Or(v, hn::Sub(hn::Set(di, f.size[axis] - 1), v));
    };
    const auto inside =
        hn::Not(hn::Lt(hn::Or(beyond(i, 0), hn::Or(beyond(j, 1), beyond(k, 2))), hn::Zero(di)));
    const auto three = hn::Set(di, 3);
    const I brick = hn::Add(hn::ShiftRight<2>(i),
                            hn::Add(hn::Mul(hn::ShiftRight<2>(j), hn::Set(di, f.bricks_x)),
                                    hn::Mul(hn::ShiftRight<2>(k), hn::Set(di, f.bricks_xy))));
    return {hn::IfThenElse(inside, brick, hn::Set(di, f.outside)),
            hn::Or(hn::And(i, three), hn::Or(hn::ShiftLeft<2>(hn::And(j, three)),
                                             hn::ShiftLeft<4>(hn::And(k, three)))),
            {hn::Sub(p.x, hn::Sub(hx, shift)), hn::Sub(p.y, hn::Sub(hy, shift)),
             hn::Sub(p.z, hn::Sub(hz, shift))}};
}

// What the table holds for bricks.
template <class D>
struct Bricks {
    IntOf<D> word, boundary;
};
template <class D, class I>
HWY_INLINE Bricks<D> bricks_of(D, const TruthFrameRows& f, I brick) {
    static_assert(sizeof(TruthBrick) == 8 && offsetof(TruthBrick, boundary) == 4);
    const hn::RebindToSigned<D> di;
    const auto* table = reinterpret_cast<const std::int32_t*>(f.bricks);
    const auto word = hn::GatherIndex(di, table, hn::Add(brick, brick));
    const auto plain = hn::Set(di, static_cast<std::int32_t>(kOneLabel));
    const auto marks = hn::Set(di, static_cast<std::int32_t>(kOneLabel | kHasSurface));
    // Bricks of one label and no surface: most of a body.
    if (hn::AllTrue(di, hn::Eq(hn::And(word, marks), plain))) return {word, plain};
    return {word, hn::GatherIndex(di, table + 1, hn::Add(brick, brick))};
}

template <class D>
HWY_INLINE IntOf<D> labels_of(
    D d, const TruthFrameRows& f, const Bricks<D>& bricks, IntOf<D> cell, const Places<D>& off) {
    const hn::RebindToSigned<D> di;
    using I = IntOf<D>;
    const I word = bricks.word, zero = hn::Zero(di);
    I label = hn::And(word, hn::Set(di, 0xFF));
    const auto marks = hn::Set(di, static_cast<std::int32_t>(kOneLabel | kHasSurface));
    const auto plain = hn::Set(di, static_cast<std::int32_t>(kOneLabel));
    if (hn::AllTrue(di, hn::Eq(hn::And(word, marks), plain))) return label;
    const auto mixed = hn::Not(hn::Lt(word, zero));
    if (!hn::AllFalse(di, mixed)) {
        const I at = hn::IfThenElseZero(mixed, hn::Or(hn::ShiftLeft<6>(word), cell));
        label = hn::IfThenElse(mixed, hn::And(pool_byte(di, f.label_pool, at), hn::Set(di, 0xFF)),
                               label);
    }
    const I low = hn::And(bricks.boundary, hn::Set(di, 0x7FFFFFFF));
    const auto stored = hn::Not(hn::Lt(bricks.boundary, zero));
    I record = hn::Set(di, static_cast<std::int32_t>(kNoBoundary));
    if (!f.plain_boundaries)
        record = hn::GatherIndex(di, f.boundary_uniform, hn::IfThenZeroElse(stored, low));
    if (!hn::AllFalse(di, stored)) {
        const I at = hn::IfThenElseZero(stored, hn::Or(hn::ShiftLeft<6>(low), cell));
        record = hn::IfThenElse(stored, hn::GatherIndex(di, f.boundary_pool, at), record);
    }
    return side_of_surface(d, f, record, label, off);
}

// A stretch of a run, on its way from places to labels. Table and pools lie far apart in memory: a
// vector that waits for each in turn takes twice as long as one whose numbers were asked for while
// others were worked on.
constexpr int kStretch = 128;
struct Stretch {
    HWY_ALIGN float x[kStretch + kMaxLanes], y[kStretch + kMaxLanes], z[kStretch + kMaxLanes];
    HWY_ALIGN std::int32_t brick[kStretch + kMaxLanes], cell[kStretch + kMaxLanes],
        word[kStretch + kMaxLanes], boundary[kStretch + kMaxLanes], state[kStretch + kMaxLanes];
};
constexpr std::int32_t kInAir = 1, kClosed = 2;  // of Stretch::state

// A voxel is wider than two pixels.
constexpr int kAskEvery = 4;
inline void ask_for_bricks(const TruthFrameRows& f, const Stretch& s, int begin, int end) {
    for (int n = begin; n < end; n += kAskEvery) hwy::Prefetch(f.bricks + s.brick[n]);
}
inline void ask_for_voxels(const TruthFrameRows& f, const Stretch& s, int begin, int end) {
    for (int n = begin; n < end; n += kAskEvery) {
        const auto cell = static_cast<std::uint32_t>(s.cell[n]);
        const auto word = static_cast<std::uint32_t>(s.word[n]),
                   boundary = static_cast<std::uint32_t>(s.boundary[n]);
        if (s.word[n] >= 0) hwy::Prefetch(f.label_pool + (word << 4 | cell >> 2));
        if (s.boundary[n] >= 0)
            hwy::Prefetch(f.boundary_pool + (static_cast<std::size_t>(boundary) << 6 | cell));
    }
}

// The label that the fine region holds where it covers a point, and `label` elsewhere.
template <class D, class I>
HWY_NOINLINE I labels_of_region(D d, const TruthFrameRows& f, const Places<D>& p, I label) {
    auto here = hn::Eq(p.x, p.x);
    const auto own = [&](auto at, int a) HWY_ATTR {
        here = hn::And(here, hn::And(hn::Ge(at, hn::Set(d, f.region_lower[a])),
                                     hn::Lt(at, hn::Set(d, f.region_upper[a]))));
        return hn::Add(hn::Mul(at, hn::Set(d, f.region_per_voxel)), hn::Set(d, f.region_first[a]));
    };
    const Places<D> place{own(p.x, 0), own(p.y, 1), own(p.z, 2)};
    if (hn::AllFalse(d, here)) return label;
    const auto mask = hn::RebindMask(hn::RebindToSigned<D>(), here);
    const Voxels<D> voxels = voxels_of(d, *f.region, place);
    return hn::IfThenElse(
        mask,
        labels_of(d, *f.region, bricks_of(d, *f.region, voxels.brick), voxels.cell, voxels.off),
        label);
}

void labels_of_run(
    const TruthFrameRows& f, const TruthRun& run, int begin, int end, std::uint8_t* labels) {
    using D = hn::ScalableTag<float>;
    const D d;
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::uint8_t, D> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto iota = hn::Iota(d, 0.0f);
    const auto base = [&](int a) HWY_ATTR {
        return hn::Set(
            d, static_cast<float>(f.origin[a] + run.row * f.down[a] + run.begin * f.across[a]));
    };
    const auto base_x = base(0), base_y = base(1), base_z = base(2);
    const auto step = [&](int a) HWY_ATTR { return hn::Set(d, static_cast<float>(f.across[a])); };
    const auto step_x = step(0), step_y = step(1), step_z = step(2);
    Stretch s;
    for (int from = begin; from < end; from += kStretch) {
        const int to = std::min(from + kStretch, end);
        for (int first = from; first < to; first += lanes) {
            const int used = std::min(lanes, to - first), at = first - from;
            const auto n = hn::Add(iota, hn::Set(d, static_cast<float>(first)));
            const auto column = hn::Add(n, hn::Set(d, static_cast<float>(run.begin)));
            Places<D> p{hn::Add(base_x, hn::Mul(n, step_x)), hn::Add(base_y, hn::Mul(n, step_y)),
                        hn::Add(base_z, hn::Mul(n, step_z))};
            auto state = hn::Zero(di);
            if (f.gap_mm != nullptr) {
                auto air = hn::Zero(d);
                close_gap(d, f, run, first, used, column, air, p);
                state = hn::IfThenElseZero(hn::RebindMask(di, hn::Lt(air, hn::Zero(d))),
                                           hn::Set(di, kInAir));
            }
            if (f.press != nullptr) {
                auto closed = hn::Zero(di);
                press_back(d, f, run, first, column, p, closed);
                state = hn::Or(
                    state, hn::IfThenElseZero(hn::Gt(closed, hn::Zero(di)), hn::Set(di, kClosed)));
            }
            if (f.weight != nullptr) breathe_back(d, f, p);
            const Voxels<D> voxels = voxels_of(d, f, p);
            // A fine region is looked up from the places themselves.
            const Places<D>& kept = f.region != nullptr ? p : voxels.off;
            hn::Store(kept.x, d, s.x + at);
            hn::Store(kept.y, d, s.y + at);
            hn::Store(kept.z, d, s.z + at);
            hn::Store(voxels.brick, di, s.brick + at);
            hn::Store(voxels.cell, di, s.cell + at);
            hn::Store(state, di, s.state + at);
            ask_for_bricks(f, s, at, at + used);
        }
        for (int at = 0; at < to - from; at += lanes) {
            const Bricks<D> bricks = bricks_of(d, f, hn::Load(di, s.brick + at));
            hn::Store(bricks.word, di, s.word + at);
            hn::Store(bricks.boundary, di, s.boundary + at);
            ask_for_voxels(f, s, at, std::min(at + lanes, to - from));
        }
        for (int first = from; first < to; first += lanes) {
            const int used = std::min(lanes, to - first), at = first - from;
            const Places<D> p{hn::Load(d, s.x + at), hn::Load(d, s.y + at), hn::Load(d, s.z + at)};
            const Places<D> off = f.region != nullptr ? voxels_of(d, f, p).off : p;
            auto label =
                labels_of(d, f, Bricks<D>{hn::Load(di, s.word + at), hn::Load(di, s.boundary + at)},
                          hn::Load(di, s.cell + at), off);
            if (f.region != nullptr) label = labels_of_region(d, f, p, label);
            const auto state = hn::Load(di, s.state + at);
            if (!hn::AllTrue(di, hn::Eq(state, hn::Zero(di)))) {
                const auto is = [&](std::int32_t bit) HWY_ATTR {
                    return hn::Gt(hn::And(state, hn::Set(di, bit)), hn::Zero(di));
                };
                if (f.press != nullptr)
                    label = hn::IfThenElse(is(kClosed), hn::GatherIndex(di, f.closed_label, label),
                                           label);
                label = hn::IfThenElse(is(kInAir), hn::Zero(di), label);
            }
            const auto bytes = hn::DemoteTo(d8, label);
            if (used == lanes) {
                hn::StoreU(bytes, d8, labels + first);
            } else {
                HWY_ALIGN std::uint8_t rest[kMaxLanes];
                hn::Store(bytes, d8, rest);
                std::copy_n(rest, used, labels + first);
            }
        }
    }
}

void range_of_shifts(const press::PressView& v,
                     int first_node,
                     int last_node,
                     int first_sample,
                     int last_sample,
                     PressRange& range) {
    const hn::ScalableTag<float> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto over = [&](const std::vector<float>& plane, float* ends) HWY_ATTR {
        const float* corner =
            plane.data() + static_cast<std::ptrdiff_t>(first_sample) * v.node_stride + first_node;
        const auto any = hn::Set(d, *corner);
        auto least = any, most = any;
        for (int node = first_node; node <= last_node; node += lanes) {
            const auto in = hn::FirstN(d, static_cast<std::size_t>(last_node - node + 1));
            const float* from = corner + (node - first_node);
            for (int k = first_sample; k <= last_sample; ++k, from += v.node_stride) {
                const auto shift = hn::IfThenElse(in, hn::LoadU(d, from), any);
                least = hn::Min(least, shift);
                most = hn::Max(most, shift);
            }
        }
        ends[0] = hn::GetLane(hn::MinOfLanes(d, least));
        ends[1] = hn::GetLane(hn::MaxOfLanes(d, most));
    };
    over(v.along, range.along);
    over(v.side, range.side);
}

void shadows_of_run(const TruthRun& run,
                    std::span<const float> first_hard_mm,
                    std::uint8_t* shadowed) {
    const hn::ScalableTag<float> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const int rays = static_cast<int>(first_hard_mm.size());
    for (int first = 0; first < run.count; first += lanes) {
        const int used = std::min(lanes, run.count - first);
        const auto dark = RayNumbers(d, run, first, used, rays).of(d, first_hard_mm.data());
        const auto behind = hn::Gt(hn::LoadU(d, run.r_mm + first), dark);
        HWY_ALIGN std::uint8_t bytes[kMaxLanes];
        hn::Store(hn::DemoteTo(d8, hn::IfThenElseZero(hn::RebindMask(di, behind), hn::Set(di, 1))),
                  d8, bytes);
        std::copy_n(bytes, used, shadowed + first);
    }
}

void depths_of_run(const TruthFrameRows& f,
                   const TruthRun& run,
                   const float* entry_mm,
                   float* depth_mm) {
    const hn::ScalableTag<float> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int first = 0; first < run.count; first += lanes) {
        const auto r = hn::LoadU(d, run.r_mm + first);
        const RayNumbers ray(d, run, first, std::min(lanes, run.count - first), f.rays);
        auto depth = hn::Sub(r, ray.of(d, entry_mm));
        if (f.gap_mm != nullptr) {
            const auto gap = hn::Max(ray.of(d, f.gap_mm), hn::Zero(d));
            if (!hn::AllFalse(d, hn::Gt(gap, hn::Zero(d))))
                depth = hn::Add(depth,
                                hn::Mul(gap, exp2_fading(d, hn::Mul(r, hn::Set(d, -f.per_reach)))));
        }
        if (first + lanes <= run.count) {
            hn::StoreU(depth, d, depth_mm + first);
        } else {
            HWY_ALIGN float rest[kMaxLanes];
            hn::Store(depth, d, rest);
            std::copy_n(rest, run.count - first, depth_mm + first);
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(labels_of_run);
HWY_EXPORT(range_of_shifts);
HWY_EXPORT(shadows_of_run);
HWY_EXPORT(depths_of_run);

void truth_labels(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  int begin,
                  int end,
                  std::uint8_t* labels) {
    HWY_DISPATCH_TABLE(labels_of_run)[simd.index](frame, run, begin, end, labels);
}

PressRange press_range(SimdTarget simd,
                       const press::PressView& view,
                       int first_node,
                       int last_node,
                       int first_sample,
                       int last_sample) {
    PressRange range;
    HWY_DISPATCH_TABLE(range_of_shifts)
    [simd.index](view, first_node, last_node, first_sample, last_sample, range);
    return range;
}

void truth_shadows(SimdTarget simd,
                   const TruthRun& run,
                   std::span<const float> first_hard_mm,
                   std::uint8_t* shadowed) {
    HWY_DISPATCH_TABLE(shadows_of_run)[simd.index](run, first_hard_mm, shadowed);
}

void truth_depths(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  const float* entry_mm,
                  float* depth_mm) {
    HWY_DISPATCH_TABLE(depths_of_run)[simd.index](frame, run, entry_mm, depth_mm);
}

}  // namespace sonocase::runtime
#endif
