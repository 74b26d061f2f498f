// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_rows.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

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

// Points of the scan plane: where they lie in it, their depth and their ray, as a fraction.
template <class D>
struct PlanePoints {
    hn::Vec<D> x_mm, z_mm, r_mm, ray;
};

// Contact: moves each point along its beam by gap exp(-r / reach).
template <class D, class V>
HWY_INLINE void close_gap(
    D d, const TruthFrameRows& f, const PlanePoints<D>& at, V gap, Places<D>& p) {
    if (hn::AllFalse(d, hn::Gt(gap, hn::Zero(d)))) return;  // nothing moves
    const auto shift = hn::Mul(hn::Max(gap, hn::Zero(d)),
                               exp2_fading(d, hn::Mul(at.r_mm, hn::Set(d, -f.per_reach))));
    auto along_x = hn::Zero(d), along_z = shift;
    if (f.fan) {
        const auto radius = hn::Set(d, f.radius_mm);
        const auto away = hn::Max(hn::Add(at.r_mm, radius), hn::Set(d, 1e-3f));
        const auto part = hn::Div(shift, away);
        along_x = hn::Mul(part, at.x_mm);
        along_z = hn::Mul(part, hn::Add(at.z_mm, radius));
    }
    const auto moved = [&](V v, int axis) HWY_ATTR {
        return hn::Add(v, hn::Add(hn::Mul(along_x, hn::Set(d, f.beam_x[axis])),
                                  hn::Mul(along_z, hn::Set(d, f.beam_z[axis]))));
    };
    p = {moved(p.x, 0), moved(p.y, 1), moved(p.z, 2)};
}

// Pressing: moves each point back to where its tissue lies at rest. closed: 1 in a closed lumen.
template <class D, class I>
HWY_NOINLINE void press_back(
    D d, const TruthFrameRows& f, const PlanePoints<D>& at, Places<D>& p, I& closed) {
    namespace lanes = press::HWY_NAMESPACE;
    using V = hn::Vec<D>;
    const hn::RebindToSigned<D> di;
    const auto half = hn::Set(d, 0.5f);
    auto dx = hn::Zero(d), dz = hn::Set(d, 1.0f);
    if (f.fan) {
        const auto radius = hn::Set(d, f.radius_mm);
        const auto away = hn::Max(hn::Add(at.r_mm, radius), hn::Set(d, 1e-3f));
        dx = hn::Div(at.x_mm, away);
        dz = hn::Div(hn::Add(at.z_mm, radius), away);
    }
    const auto line = hn::Sub(hn::Mul(at.ray, hn::Set(d, f.lines_per_ray)), half);
    const lanes::PlaceLanes<D> place{at.x_mm, at.z_mm, dx, dz, line, at.r_mm};
    const lanes::ShiftLanes<D> shift = lanes::shift_lanes(d, *f.press, place);
    const auto move_x = hn::Add(hn::Mul(shift.along, dx), hn::Mul(shift.side, dz));
    const auto move_z = hn::Sub(hn::Mul(shift.along, dz), hn::Mul(shift.side, dx));
    const auto moved = [&](V v, int axis) HWY_ATTR {
        return hn::Add(v, hn::Add(hn::Mul(move_x, hn::Set(d, f.beam_x[axis])),
                                  hn::Mul(move_z, hn::Set(d, f.beam_z[axis]))));
    };
    p = {moved(p.x, 0), moved(p.y, 1), moved(p.z, 2)};
    closed = hn::Zero(di);
    if (f.press->pressed && f.press->field->closed_marks().any)
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
    // Walls of vessels move outwards, seen from both sides of them. Most points lie farther away
    // from any surface.
    const float most_vx = std::max(std::abs(f.pulse_vx), std::abs(f.vein_vx)) * 1.001f;
    if (most_vx > 0 && !hn::AllFalse(d, hn::And(hn::RebindMask(d, near),
                                                hn::Le(hn::Abs(side), hn::Set(d, 2 * most_vx))))) {
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
// centres. kInside: all lie in the volume.
template <class D>
struct Voxels {
    IntOf<D> brick, cell;
    Places<D> off;
};
template <bool kInside = false, class D>
HWY_INLINE Voxels<D> voxels_of(D d, const TruthFrameRows& f, const Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using I = IntOf<D>;
    // TruthRenderer draws no frame so far away that this is not exact.
    const auto shift = hn::Set(d, kRoundingShift);
    const auto bits = hn::Set(di, kRoundingBits);
    const auto hx = hn::Add(p.x, shift), hy = hn::Add(p.y, shift), hz = hn::Add(p.z, shift);
    const I i = hn::Sub(hn::BitCast(di, hx), bits), j = hn::Sub(hn::BitCast(di, hy), bits),
            k = hn::Sub(hn::BitCast(di, hz), bits);
    const auto three = hn::Set(di, 3);
    I brick = hn::Add(hn::ShiftRight<2>(i),
                      hn::Add(hn::Mul(hn::ShiftRight<2>(j), hn::Set(di, f.bricks_x)),
                              hn::Mul(hn::ShiftRight<2>(k), hn::Set(di, f.bricks_xy))));
    if constexpr (!kInside) {
        // An index is inside where neither it nor what is left to the last one is negative.
        const auto beyond = [&](I v, int axis) HWY_ATTR {
            return hn::Or(v, hn::Sub(hn::Set(di, f.size[axis] - 1), v));
        };
        const auto inside =
            hn::Not(hn::Lt(hn::Or(beyond(i, 0), hn::Or(beyond(j, 1), beyond(k, 2))), hn::Zero(di)));
        brick = hn::IfThenElse(inside, brick, hn::Set(di, f.outside));
    }
    return {brick,
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
inline void ask_for_voxel(const TruthFrameRows& f,
                          std::int32_t word,
                          std::int32_t boundary,
                          std::int32_t cell) {
    const auto at = static_cast<std::uint32_t>(cell);
    if (word >= 0) hwy::Prefetch(f.label_pool + (static_cast<std::uint32_t>(word) << 4 | at >> 2));
    if (boundary >= 0)
        hwy::Prefetch(f.boundary_pool + (static_cast<std::size_t>(boundary) << 6 | at));
}
inline void ask_for_voxels(const TruthFrameRows& f, const Stretch& s, int begin, int end) {
    for (int n = begin; n < end; n += kAskEvery)
        ask_for_voxel(f, s.word[n], s.boundary[n], s.cell[n]);
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

// Where the pixels of a run lie at rest.
template <class D>
class RunPlaces {
  public:
    HWY_INLINE RunPlaces(D d, const TruthFrameRows& f, const TruthRun& run)
        : f_(f), run_(run), base_{base(d, 0), base(d, 1), base(d, 2)} {}

    // first: of a vector of pixels, of which `used` belong to the run. state: kInAir and kClosed.
    HWY_INLINE Places<D> at(D d, int first, int used, IntOf<D>& state) const {
        const hn::RebindToSigned<D> di;
        const auto n = hn::Add(hn::Iota(d, 0.0f), hn::Set(d, static_cast<float>(first)));
        const auto column = hn::Add(n, hn::Set(d, static_cast<float>(run_.begin)));
        const PlanePoints<D> point{
            hn::Mul(hn::Sub(column, hn::Set(d, f_.origin_x_px)), hn::Set(d, f_.mm_per_px)),
            hn::Set(d, (static_cast<float>(run_.row) - f_.origin_y_px) * f_.mm_per_px),
            hn::LoadU(d, run_.r_mm + first),
            hn::Add(hn::ConvertTo(d, rays_of(d, run_, first)), hn::Set(d, 0.5f))};
        const auto along = [&](hn::Vec<D> from, int a) HWY_ATTR {
            return hn::Add(from, hn::Mul(n, hn::Set(d, static_cast<float>(f_.across[a]))));
        };
        Places<D> p{along(base_.x, 0), along(base_.y, 1), along(base_.z, 2)};
        state = hn::Zero(di);
        if (f_.gap_mm != nullptr) {
            const auto gap = RayNumbers<D>(d, run_, first, used, f_.rays).of(d, f_.gap_mm);
            close_gap(d, f_, point, gap, p);
            state = hn::IfThenElseZero(hn::RebindMask(di, hn::Lt(gap, hn::Zero(d))),
                                       hn::Set(di, kInAir));
        }
        if (f_.press != nullptr) {
            auto closed = hn::Zero(di);
            press_back(d, f_, point, p, closed);
            state = hn::Or(state,
                           hn::IfThenElseZero(hn::Gt(closed, hn::Zero(di)), hn::Set(di, kClosed)));
        }
        if (f_.weight != nullptr) breathe_back(d, f_, p);
        return p;
    }

  private:
    HWY_INLINE hn::Vec<D> base(D d, int a) const {
        return hn::Set(d, static_cast<float>(f_.origin[a] + run_.row * f_.down[a] +
                                             run_.begin * f_.across[a]));
    }
    const TruthFrameRows& f_;
    const TruthRun& run_;
    Places<D> base_;
};

void rest_of_run(
    const TruthFrameRows& f, const TruthRun& run, int begin, int end, float* const voxel[3]) {
    using D = hn::ScalableTag<float>;
    const D d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const RunPlaces<D> places(d, f, run);
    for (int first = begin; first < end; first += lanes) {
        const int used = std::min(lanes, end - first);
        auto state = hn::Zero(hn::RebindToSigned<D>());
        const Places<D> p = places.at(d, first, used, state);
        const auto in_air =
            hn::RebindMask(d, hn::Ne(hn::And(state, hn::Set(hn::RebindToSigned<D>(), kInAir)),
                                     hn::Zero(hn::RebindToSigned<D>())));
        const auto none = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
        HWY_ALIGN float rest[kMaxLanes];
        const auto store = [&](hn::Vec<D> v, int a) HWY_ATTR {
            hn::Store(hn::IfThenElse(in_air, none, v), d, rest);
            std::copy_n(rest, used, voxel[a] + first);
        };
        store(p.x, 0), store(p.y, 1), store(p.z, 2);
    }
}

void labels_of_run(
    const TruthFrameRows& f, const TruthRun& run, int begin, int end, std::uint8_t* labels) {
    using D = hn::ScalableTag<float>;
    const D d;
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::uint8_t, D> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const RunPlaces<D> places(d, f, run);
    Stretch s;
    for (int from = begin; from < end; from += kStretch) {
        const int to = std::min(from + kStretch, end);
        for (int first = from; first < to; first += lanes) {
            const int used = std::min(lanes, to - first), at = first - from;
            auto state = hn::Zero(di);
            const Places<D> p = places.at(d, first, used, state);
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

// Lanes of a tile's kernels: its points, or half a row of its pixels.
using TileD = hn::CappedTag<float, TruthTile::kPoints>;

bool places_of_tile(const TruthFrameRows& f, const TruthTile& tile, TilePlaces& places) {
    const TileD d;
    const hn::RebindToSigned<TileD> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto number = [&](float x) HWY_ATTR { return hn::Set(d, x); };
    for (int n = 0; n < TruthTile::kPoints; n += lanes) {
        const auto beside = hn::LoadU(d, TruthTile::kBeside + n),
                   below = hn::LoadU(d, TruthTile::kBelow + n);
        const auto base = [&](int a) HWY_ATTR {
            const auto first =
                static_cast<float>(f.origin[a] + tile.row * f.down[a] + tile.column * f.across[a]);
            return hn::Add(number(first),
                           hn::Add(hn::Mul(beside, number(static_cast<float>(f.across[a]))),
                                   hn::Mul(below, number(static_cast<float>(f.down[a])))));
        };
        Places<TileD> p{base(0), base(1), base(2)};
        const auto ray = hn::LoadU(d, tile.ray + n);
        const auto whole = hn::Floor(ray);
        const PlanePoints<TileD> at{
            hn::Mul(hn::Add(beside, number(static_cast<float>(tile.column) - f.origin_x_px)),
                    number(f.mm_per_px)),
            hn::Mul(hn::Add(below, number(static_cast<float>(tile.row) - f.origin_y_px)),
                    number(f.mm_per_px)),
            hn::LoadU(d, tile.r_mm + n), hn::Add(ray, number(0.5f))};
        if (f.gap_mm != nullptr) {
            const auto left = hn::ConvertTo(di, whole);
            const auto gap = hn::GatherIndex(d, f.gap_mm, left),
                       next = hn::GatherIndex(d, f.gap_mm + 1, left);
            close_gap(d, f, at, hn::Add(gap, hn::Mul(hn::Sub(ray, whole), hn::Sub(next, gap))), p);
        }
        if (f.press != nullptr) {
            auto closed = hn::Zero(di);
            press_back(d, f, at, p, closed);
        }
        if (f.weight != nullptr) breathe_back(d, f, p);
        hn::Store(p.x, d, places.voxel[0] + n);
        hn::Store(p.y, d, places.voxel[1] + n);
        hn::Store(p.z, d, places.voxel[2] + n);
    }
    float off = 0;
    for (int a = 0; a < 3; ++a) {
        const float *v = places.voxel[a], *w = v + 3;
        const float l = v[0] + w[0], m = v[1] + w[1], r = v[2] + w[2];  // halfway down, twice
        off = std::max({off, std::abs(0.5f * (0.375f * l + 0.75f * m - 0.125f * r) - v[6]),
                        std::abs(0.5f * (0.375f * r + 0.75f * m - 0.125f * l) - v[7])});
        // A parabola leaves the span of its points by an eighth of their second difference at most.
        const float bulge =
            0.125f * std::max(std::abs(v[0] - 2 * v[1] + v[2]), std::abs(w[0] - 2 * w[1] + w[2]));
        places.lower[a] = std::min({v[0], v[1], v[2], w[0], w[1], w[2]}) - bulge;
        places.upper[a] = std::max({v[0], v[1], v[2], w[0], w[1], w[2]}) + bulge;
    }
    return off <= f.max_off_vx;
}

template <bool kInside>
void voxels_of_tile(const TruthFrameRows& f, const TilePlaces& places, int rows, TileVoxels& out) {
    constexpr int kColumns = TruthTile::kColumns;
    const TileD d;
    const hn::RebindToSigned<TileD> di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    // Places in the first row, and from row to row.
    HWY_ALIGN float first[3][kColumns], down[3][kColumns];
    for (int at = 0; at < kColumns; at += lanes) {
        const auto left = hn::LoadU(d, kTileColumns.left + at),
                   middle = hn::LoadU(d, kTileColumns.middle + at),
                   right = hn::LoadU(d, kTileColumns.right + at);
        for (int a = 0; a < 3; ++a) {
            const auto row = [&](const float* v) HWY_ATTR {
                return hn::Add(
                    hn::Mul(left, hn::Set(d, v[0])),
                    hn::Add(hn::Mul(middle, hn::Set(d, v[1])), hn::Mul(right, hn::Set(d, v[2]))));
            };
            const auto top = row(places.voxel[a]);
            hn::Store(top, d, first[a] + at);
            hn::Store(hn::Mul(hn::Sub(row(places.voxel[a] + 3), top),
                              hn::Set(d, 1.0f / (TruthTile::kRows - 1))),
                      d, down[a] + at);
        }
    }
    for (int row = 0, n = 0; row < rows; ++row) {
        const auto by = hn::Set(d, static_cast<float>(row));
        for (int at = 0; at < kColumns; at += lanes, n += lanes) {
            const auto place = [&](int a) HWY_ATTR {
                return hn::Add(hn::Load(d, first[a] + at), hn::Mul(by, hn::Load(d, down[a] + at)));
            };
            const Voxels<TileD> voxels =
                voxels_of<kInside>(d, f, Places<TileD>{place(0), place(1), place(2)});
            const Bricks<TileD> bricks = bricks_of(d, f, voxels.brick);
            hn::Store(voxels.off.x, d, out.x + n);
            hn::Store(voxels.off.y, d, out.y + n);
            hn::Store(voxels.off.z, d, out.z + n);
            hn::Store(voxels.cell, di, out.cell + n);
            hn::Store(bricks.word, di, out.word + n);
            hn::Store(bricks.boundary, di, out.boundary + n);
        }
        if (row % 2 == 0)
            for (int at = n - kColumns; at < n; at += kAskEvery)
                ask_for_voxel(f, out.word[at], out.boundary[at], out.cell[at]);
    }
}

void voxels_of_inner_tile(const TruthFrameRows& f,
                          const TilePlaces& places,
                          int rows,
                          TileVoxels& out) {
    voxels_of_tile<true>(f, places, rows, out);
}
void voxels_of_outer_tile(const TruthFrameRows& f,
                          const TilePlaces& places,
                          int rows,
                          TileVoxels& out) {
    voxels_of_tile<false>(f, places, rows, out);
}

bool labels_of_tile(const TruthFrameRows& f,
                    const TileVoxels& voxels,
                    int rows,
                    int columns,
                    std::uint8_t* labels,
                    std::ptrdiff_t stride) {
    constexpr int kColumns = TruthTile::kColumns;
    const TileD d;
    const hn::RebindToSigned<TileD> di;
    const hn::Rebind<std::uint8_t, TileD> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int row = 0, n = 0; row < rows; ++row, labels += stride) {
        for (int at = 0; at < kColumns; at += lanes, n += lanes) {
            const auto label = labels_of(
                d, f,
                Bricks<TileD>{hn::Load(di, voxels.word + n), hn::Load(di, voxels.boundary + n)},
                hn::Load(di, voxels.cell + n),
                Places<TileD>{hn::Load(d, voxels.x + n), hn::Load(d, voxels.y + n),
                              hn::Load(d, voxels.z + n)});
            if (f.closes &&
                !hn::AllTrue(di, hn::Eq(label, hn::GatherIndex(di, f.closed_label, label))))
                return false;
            const auto bytes = hn::DemoteTo(d8, label);
            if (at + lanes <= columns) {
                hn::StoreU(bytes, d8, labels + at);
            } else if (at < columns) {
                HWY_ALIGN std::uint8_t rest[kMaxLanes];
                hn::Store(bytes, d8, rest);
                std::copy_n(rest, columns - at, labels + at);
            }
        }
    }
    return true;
}

void beams_of_run(const TruthFrameRows& frame, const TruthRun& of, const BeamPlanes& into) {
    // Copies, which no write to a plane can change, stay in registers.
    const TruthRun run = of;
    const BeamPlanes planes = into;
    const float* gaps = frame.gap_mm;
    const float per_reach = -frame.per_reach;
    const int rays = frame.rays;
    const hn::ScalableTag<float> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int first = 0; first < run.count; first += lanes) {
        const int used = std::min(lanes, run.count - first);
        const auto r = hn::LoadU(d, run.r_mm + first);
        const RayNumbers ray(d, run, first, used, rays);
        if (planes.shadowed != nullptr) {
            const auto behind = hn::RebindMask(di, hn::Gt(r, ray.of(d, planes.first_hard_mm)));
            const auto bytes = hn::DemoteTo(d8, hn::IfThenElseZero(behind, hn::Set(di, 1)));
            if (used == lanes) {
                hn::StoreU(bytes, d8, planes.shadowed + first);
            } else {
                HWY_ALIGN std::uint8_t rest[kMaxLanes];
                hn::Store(bytes, d8, rest);
                std::copy_n(rest, used, planes.shadowed + first);
            }
        }
        if (planes.depth_mm == nullptr) continue;
        auto depth = hn::Sub(r, ray.of(d, planes.entry_mm));
        if (gaps != nullptr) {
            const auto gap = hn::Max(ray.of(d, gaps), hn::Zero(d));
            if (!hn::AllFalse(d, hn::Gt(gap, hn::Zero(d))))
                depth =
                    hn::Add(depth, hn::Mul(gap, exp2_fading(d, hn::Mul(r, hn::Set(d, per_reach)))));
        }
        if (used == lanes) {
            hn::StoreU(depth, d, planes.depth_mm + first);
        } else {
            HWY_ALIGN float rest[kMaxLanes];
            hn::Store(depth, d, rest);
            std::copy_n(rest, used, planes.depth_mm + first);
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(labels_of_run);
HWY_EXPORT(rest_of_run);
HWY_EXPORT(places_of_tile);
HWY_EXPORT(voxels_of_inner_tile);
HWY_EXPORT(voxels_of_outer_tile);
HWY_EXPORT(labels_of_tile);
HWY_EXPORT(beams_of_run);

void truth_labels(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  int begin,
                  int end,
                  std::uint8_t* labels) {
    HWY_DISPATCH_TABLE(labels_of_run)[simd.index](frame, run, begin, end, labels);
}

void truth_rest(SimdTarget simd,
                const TruthFrameRows& frame,
                const TruthRun& run,
                int begin,
                int end,
                float* const voxel[3]) {
    HWY_DISPATCH_TABLE(rest_of_run)[simd.index](frame, run, begin, end, voxel);
}

bool truth_places(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthTile& tile,
                  TilePlaces& places) {
    return HWY_DISPATCH_TABLE(places_of_tile)[simd.index](frame, tile, places);
}

void truth_voxels(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TilePlaces& places,
                  bool inside,
                  int rows,
                  TileVoxels& voxels) {
    if (inside)
        HWY_DISPATCH_TABLE(voxels_of_inner_tile)[simd.index](frame, places, rows, voxels);
    else
        HWY_DISPATCH_TABLE(voxels_of_outer_tile)[simd.index](frame, places, rows, voxels);
}

bool truth_tile(SimdTarget simd,
                const TruthFrameRows& frame,
                const TileVoxels& voxels,
                int rows,
                int columns,
                std::uint8_t* labels,
                std::ptrdiff_t stride) {
    return HWY_DISPATCH_TABLE(labels_of_tile)[simd.index](frame, voxels, rows, columns, labels,
                                                          stride);
}

void truth_beams(SimdTarget simd,
                 const TruthFrameRows& frame,
                 const TruthRun& run,
                 const BeamPlanes& planes) {
    HWY_DISPATCH_TABLE(beams_of_run)[simd.index](frame, run, planes);
}

}  // namespace sonocase::runtime
#endif
