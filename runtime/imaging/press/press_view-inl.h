// SPDX-License-Identifier: Apache-2.0

// The shifts of pressed tissue along a stretch of a block of beams, in lanes. Included once per
// instruction set.
#include <hwy/highway.h>

#include "runtime/imaging/core/simd_math-inl.h"
#include "runtime/imaging/press/press_view.h"

#if defined(SONOCASE_PRESS_VIEW_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_PRESS_VIEW_INL_H
#undef SONOCASE_PRESS_VIEW_INL_H
#else
#define SONOCASE_PRESS_VIEW_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace math = sonocase::runtime::HWY_NAMESPACE;

// Interpolates the numbers of a vector of beams between those of the nodes around them.
template <class D>
class BetweenNodes {
  public:
    // line: the vector's first beam in the picture.
    HWY_INLINE BetweenNodes(D d, const PressView& v, int line)
        : d_(d),
          first_(line >> v.every_log2),
          node_(hn::SetTableIndices(d, v.node_of + (line & (v.every - 1)))),
          part_(hn::LoadU(d, v.part_of + (line & (v.every - 1)))) {}
    // row: a row of a plane of nodes
    HWY_INLINE hn::Vec<D> operator()(const float* row) const {
        const auto before = hn::TableLookupLanes(hn::LoadU(d_, row + first_), node_),
                   after = hn::TableLookupLanes(hn::LoadU(d_, row + first_ + 1), node_);
        return hn::Add(before, hn::Mul(part_, hn::Sub(after, before)));
    }

  private:
    D d_;
    int first_;
    decltype(hn::SetTableIndices(D(), static_cast<const std::int32_t*>(nullptr))) node_;
    hn::Vec<D> part_;
};

// PlaneShift::tilt of sample k; line: the vector's first beam.
template <class D>
HWY_INLINE hn::Vec<D> press_tilt(D d, const PressView& v, int line, int k) {
    if (!v.pressed || k >= v.capacity) return hn::Zero(d);
    return BetweenNodes<D>(d, v,
                           line)(v.tilt.data() + static_cast<std::ptrdiff_t>(k) * v.node_stride);
}

// Places of the scan plane, the directions of their beams, and where they lie among beams.
template <class D>
struct PlaceLanes {
    hn::Vec<D> x, z, dx, dz;
    hn::Vec<D> line, r;
};
template <class D>
HWY_INLINE PlaceLanes<D> places_of_beams(D d, const PressView& v, int line, int k) {
    const auto r = hn::Set(d, (static_cast<float>(k) + 0.5f) * v.step_mm);
    const auto dx = hn::LoadU(d, v.beam_row(2) + line), dz = hn::LoadU(d, v.beam_row(3) + line);
    return {hn::Add(hn::LoadU(d, v.beam_row(0) + line), hn::Mul(r, dx)),
            hn::Add(hn::LoadU(d, v.beam_row(1) + line), hn::Mul(r, dz)),
            dx,
            dz,
            hn::Iota(d, static_cast<float>(line)),
            r};
}

// zone_shift() of needle_shift.h in lanes, at rho^2 and z of the needle's frame, as factors of the
// axis and of the vector away from it.
template <class D, class V>
HWY_INLINE void add_zone(
    D d, const NeedleZone& zone, double strength_mm, V rho2, V z, V& along_axis, V& outward) {
    const double w2 = 2 * zone.width_mm * zone.width_mm, b2 = 2 * zone.length_mm * zone.length_mm;
    constexpr double kLog2E = 1.4426950408889634;
    const auto from = hn::Sub(z, hn::Set(d, static_cast<float>(zone.middle_mm)));
    const auto wide = hn::Mul(rho2, hn::Set(d, static_cast<float>(1 / w2)));
    const auto q =
        hn::Add(wide, hn::Mul(hn::Mul(from, from), hn::Set(d, static_cast<float>(1 / b2))));
    const auto g =
        hn::Mul(hn::Set(d, static_cast<float>(strength_mm)),
                math::exp2_fading(d, hn::Mul(q, hn::Set(d, static_cast<float>(-kLog2E)))));
    along_axis = hn::Add(along_axis, hn::Mul(g, hn::Sub(hn::Set(d, 1.0f), wide)));
    outward = hn::Add(outward, hn::Mul(g, hn::Mul(from, hn::Set(d, static_cast<float>(1 / b2)))));
}

// A number of a plane of nodes at a fraction of a sample and of a node.
template <class D, class V>
HWY_INLINE V at_place(D d, const PressView& v, const std::vector<float>& plane, V node, V sample) {
    const hn::RebindToSigned<D> di;
    const auto bounded = [&](V x, int last) HWY_ATTR {
        return hn::Min(hn::Max(x, hn::Zero(d)), hn::Set(d, static_cast<float>(last)));
    };
    const int rows = std::min(v.active, v.capacity);
    const auto n = bounded(node, v.node_stride - 1), k = bounded(sample, rows - 1);
    const auto ni = hn::Min(hn::ConvertTo(di, n), hn::Set(di, v.node_stride - 2)),
               ki = hn::Min(hn::ConvertTo(di, k), hn::Set(di, std::max(rows - 2, 0)));
    const auto across = hn::Sub(n, hn::ConvertTo(d, ni)), down = hn::Sub(k, hn::ConvertTo(d, ki));
    const auto place = hn::Add(hn::Mul(ki, hn::Set(di, v.node_stride)), ni);
    const auto row = [&](const float* from) HWY_ATTR {
        const auto left = hn::GatherIndex(d, from, place),
                   right = hn::GatherIndex(d, from + 1, place);
        return hn::Add(left, hn::Mul(across, hn::Sub(right, left)));
    };
    const auto above = row(plane.data()), below = row(plane.data() + v.node_stride);
    return hn::Add(above, hn::Mul(down, hn::Sub(below, above)));
}

// The shift by a needle, along the beams and beside them; false where it reaches none of the
// places.
template <class D, class V>
HWY_INLINE bool needle_lanes(D d, const PressView& v, const PlaceLanes<D>& p, V& by, V& aside) {
    const NeedleDent& needle = v.field->needle();
    const auto number = [&](double x) HWY_ATTR { return hn::Set(d, static_cast<float>(x)); };
    const auto qx = hn::Sub(p.x, number(needle.tip.x)), qz = hn::Sub(p.z, number(needle.tip.z));
    const auto qy = number(-needle.tip.y);
    const auto distance2 = hn::Add(hn::Add(hn::Mul(qx, qx), hn::Mul(qz, qz)), hn::Mul(qy, qy));
    const auto near = hn::Lt(distance2, number(kDentReachMm * kDentReachMm));
    if (hn::AllFalse(d, near)) return false;
    const auto ax = number(needle.axis.x), ay = number(needle.axis.y), az = number(needle.axis.z);
    const auto z = hn::Add(hn::Add(hn::Mul(qx, ax), hn::Mul(qz, az)), hn::Mul(qy, ay));
    const auto rho2 = hn::Max(hn::Sub(distance2, hn::Mul(z, z)), hn::Zero(d));
    auto along_axis = hn::Zero(d), outward = hn::Zero(d);
    add_zone(d, kTentZone, needle.tent_mm, rho2, z, along_axis, outward);
    add_zone(d, kDragZone, needle.drag_mm, rho2, z, along_axis, outward);
    const auto u = [&](V q, V axis) HWY_ATTR {
        const auto beside = hn::Sub(q, hn::Mul(z, axis));
        return hn::IfThenElseZero(near,
                                  hn::Add(hn::Mul(along_axis, axis), hn::Mul(outward, beside)));
    };
    const auto ux = u(qx, ax), uz = u(qz, az);
    by = hn::Add(hn::Mul(ux, p.dx), hn::Mul(uz, p.dz));
    aside = hn::Sub(hn::Mul(ux, p.dz), hn::Mul(uz, p.dx));
    return true;
}

template <class D>
struct ShiftLanes {
    hn::Vec<D> along, side;
};

// shift_by_pools() in lanes.
template <class D>
HWY_INLINE void pool_lanes(D d, const PressView& v, const PlaceLanes<D>& p, ShiftLanes<D>& s) {
    const auto number = [&](double x) HWY_ATTR { return hn::Set(d, static_cast<float>(x)); };
    const auto one = number(1);
    auto x = hn::Add(p.x, hn::Add(hn::Mul(s.along, p.dx), hn::Mul(s.side, p.dz)));
    auto z = hn::Add(p.z, hn::Sub(hn::Mul(s.along, p.dz), hn::Mul(s.side, p.dx)));
    for (const SceneChange::Pool& pool : v.field->pools()) {
        const auto ax = hn::Sub(x, number(pool.centre.x)), az = hn::Sub(z, number(pool.centre.z));
        const auto y2 = number(pool.centre.y * pool.centre.y);
        const auto r2 = hn::Add(hn::Add(hn::Mul(ax, ax), hn::Mul(az, az)), y2);
        const auto radii2 = hn::Mul(r2, number(1 / (pool.radius_mm * pool.radius_mm)));
        const auto near = hn::Lt(radii2, number(kPoolReaches * kPoolReaches));
        if (hn::AllFalse(d, near)) continue;
        const auto radii = hn::Sqrt(hn::Max(radii2, one));  // within the pool: of its surface
        const auto u = hn::Mul(hn::Max(hn::Sub(radii, number(kPoolFadesFrom)), hn::Zero(d)),
                               number(1 / (kPoolReaches - kPoolFadesFrom)));
        const auto fades = hn::Sub(one, hn::Mul(hn::Mul(u, u), hn::Sub(number(3), hn::Add(u, u))));
        const auto kept =
            hn::Sub(one, hn::Div(hn::Mul(number(1 - kPoolCore * kPoolCore * kPoolCore), fades),
                                 hn::Mul(hn::Mul(radii, radii), radii)));
        // The cube root: a polynomial good to 0.7 % in [k^3, 1], then once by Halley to 2e-7.
        auto root = number(-1.78480732);
        for (const double c : {4.45285457, -4.17485247, 2.22394069, 0.27626647})
            root = hn::Add(hn::Mul(root, kept), number(c));
        const auto cube = hn::Mul(hn::Mul(root, root), root);
        root = hn::Mul(
            root, hn::Div(hn::Add(cube, hn::Add(kept, kept)), hn::Add(hn::Add(cube, cube), kept)));
        const auto back = hn::IfThenElseZero(near, hn::Sub(root, one));
        const auto bx = hn::Mul(back, ax), bz = hn::Mul(back, az);
        x = hn::Add(x, bx);
        z = hn::Add(z, bz);
        s.along = hn::Add(s.along, hn::Add(hn::Mul(bx, p.dx), hn::Mul(bz, p.dz)));
        s.side = hn::Add(s.side, hn::Sub(hn::Mul(bx, p.dz), hn::Mul(bz, p.dx)));
    }
}

// PlaneShift of places anywhere but for pools: first back by the needle, then by the probe from
// there.
template <class D>
HWY_INLINE ShiftLanes<D> shift_by_needle_and_probe(D d,
                                                   const PressView& v,
                                                   const PlaceLanes<D>& p) {
    auto by = hn::Zero(d), aside = hn::Zero(d);
    if (v.field->needle().moves()) (void)needle_lanes(d, v, p, by, aside);
    if (!v.pressed) return {hn::Neg(by), hn::Neg(aside)};
    const ScanGeometry& g = *v.geometry;
    const auto number = [&](double x) HWY_ATTR { return hn::Set(d, static_cast<float>(x)); };
    if (!v.columns_follow_beams) {
        // Beams come from one point, near which a small shift is a large turn. Sine and cosine of
        // the turn to the beam of the place at rest; the arc sine is good to 0.01 within 45
        // degrees.
        const auto on = hn::Sub(p.r, by);
        const auto length =
            hn::Max(hn::Sqrt(hn::Add(hn::Mul(on, on), hn::Mul(aside, aside))), number(1e-3));
        const auto cosine = hn::Div(on, length), sine = hn::Neg(hn::Div(aside, length));
        const auto square = hn::Mul(sine, sine);
        const auto turn = hn::Mul(
            sine, hn::Add(number(1), hn::Mul(square, hn::Add(number(1 / 6.0),
                                                             hn::Mul(square, number(0.075))))));
        const auto node =
            hn::Mul(hn::Add(p.line, hn::Mul(turn, number(1 / g.line_step))), number(1.0 / v.every));
        const auto sample = hn::Sub(hn::Mul(length, number(1 / g.step_mm)), number(0.5));
        const auto along = at_place(d, v, v.along, node, sample),
                   side = at_place(d, v, v.side, node, sample);
        return {hn::Sub(hn::Sub(hn::Mul(along, cosine), hn::Mul(side, sine)), by),
                hn::Sub(hn::Add(hn::Mul(along, sine), hn::Mul(side, cosine)), aside)};
    }
    const auto pitch_mm = g.fan ? hn::Mul(hn::Max(hn::Add(p.r, number(g.radius_mm)), number(1e-3)),
                                          number(g.line_step))
                                : number(g.line_step);
    const auto node = hn::Mul(hn::Sub(p.line, hn::Div(aside, pitch_mm)), number(1.0 / v.every));
    const auto sample = hn::Sub(hn::Mul(hn::Sub(p.r, by), number(1 / g.step_mm)), number(0.5));
    return {hn::Sub(at_place(d, v, v.along, node, sample), by),
            hn::Sub(at_place(d, v, v.side, node, sample), aside)};
}

// PlaneShift of places anywhere.
template <class D>
HWY_INLINE ShiftLanes<D> shift_lanes(D d, const PressView& v, const PlaceLanes<D>& p) {
    ShiftLanes<D> shift = shift_by_needle_and_probe(d, v, p);
    if (!v.field->pools().empty()) pool_lanes(d, v, p, shift);
    return shift;
}

// 1 where places, shifted like this, lie in a collapsed lumen.
template <class D>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> closed_lanes(D d,
                                                       const PressView& v,
                                                       const PlaceLanes<D>& p,
                                                       const ShiftLanes<D>& shift) {
    const hn::RebindToSigned<D> di;
    const PressClosed& marks = v.field->closed_marks();
    constexpr float kPerStep = static_cast<float>(1 / kTableStepMm);
    const auto half = hn::Set(d, 0.5f), per_mm = hn::Set(d, v.columns_per_mm);
    const auto nearest = [&](auto x, float last) HWY_ATTR {
        return hn::ConvertTo(di, hn::Add(hn::Min(hn::Max(x, hn::Zero(d)), hn::Set(d, last)), half));
    };
    auto column = hn::Zero(d), depth = p.r;
    if (v.columns_follow_beams) {
        const auto grow = hn::Add(hn::Set(d, 1.0f),
                                  hn::Mul(hn::Add(p.r, shift.along), hn::Set(d, v.per_radius_mm)));
        column = hn::Add(
            hn::Add(hn::Set(d, v.first_column), hn::Mul(p.line, hn::Set(d, v.columns_per_line))),
            hn::Mul(hn::Div(shift.side, grow), per_mm));
    } else {
        const auto x = hn::Add(p.x, hn::Add(hn::Mul(shift.along, p.dx), hn::Mul(shift.side, p.dz)));
        column = hn::Add(hn::Mul(x, per_mm), hn::Set(d, (kColumns - 1) / 2.0f));
        depth = p.z;
    }
    const auto m = nearest(hn::Mul(depth, hn::Set(d, kPerStep)), kTableRows - 1.0f);
    const auto i = nearest(hn::Mul(column, hn::Set(d, float{PressClosed::kMarks})),
                           PressClosed::kAcross - 1.0f);
    return hn::GatherIndex(di, marks.row_of(0),
                           hn::Add(hn::Mul(m, hn::Set(di, PressClosed::kAcross)), i));
}

// False where no sample of a row can lie in a collapsed lumen.
inline bool may_close(const PressView& v, int k) {
    if (!v.columns_follow_beams) return true;
    constexpr float kPerStep = static_cast<float>(1 / kTableStepMm);
    const float r = (static_cast<float>(k) + 0.5f) * v.step_mm;
    const int m = static_cast<int>(std::min(r * kPerStep, kTableRows - 1.0f) + 0.5f);
    return v.field->closed_marks().row[m];
}

// Adds to a stretch the shift by pools, whose surfaces it does not meet: it bends so little that it
// is worked out for every `every`-th sample and is linear in between (PressMovers). still: nothing
// else moves the stretch, whose rows are not filled in yet.
template <class D>
HWY_NOINLINE void push_gently(D d,
                              const PressView& v,
                              int line,
                              int beam,
                              int first,
                              int rows,
                              int every,
                              bool still,
                              PressChunk& out) {
    const auto base = [&](const float* from)
                          HWY_ATTR { return still ? hn::Zero(d) : hn::Load(d, from); };
    const auto shift_at = [&](int row) HWY_ATTR {
        const int at = std::min(row, rows - 1);
        const ShiftLanes<D> before{base(out.along + (at + 1) * kPressBeams + beam),
                                   base(out.side + std::max(at, 0) * kPressBeams + beam)};
        ShiftLanes<D> shift = before;
        pool_lanes(d, v, places_of_beams(d, v, line, first + row), shift);
        return ShiftLanes<D>{hn::Sub(shift.along, before.along), hn::Sub(shift.side, before.side)};
    };
    const auto part = hn::Set(d, 1 / static_cast<float>(every));
    ShiftLanes<D> above = shift_at(-1);
    for (int knot = -1; knot < rows; knot += every) {
        const ShiftLanes<D> below = shift_at(knot + every);
        const auto along_more = hn::Mul(hn::Sub(below.along, above.along), part),
                   side_more = hn::Mul(hn::Sub(below.side, above.side), part);
        auto along = above.along, side = above.side;
        for (int row = knot; row < std::min(knot + every, rows); ++row) {
            float* to = out.along + (row + 1) * kPressBeams + beam;
            hn::Store(hn::Add(base(to), along), d, to);
            if (row >= 0) {
                to = out.side + row * kPressBeams + beam;
                hn::Store(hn::Add(base(to), side), d, to);
            }
            along = hn::Add(along, along_more);
            side = hn::Add(side, side_more);
        }
        above = below;
    }
}

// Fills the lanes of one vector of beams. first_beam: first beam of the block; beam: the vector's
// first within it; [first, first + rows): samples, all active; out.movers: what moves them.
template <class D>
HWY_NOINLINE void press_chunk(
    D d, const PressView& v, int first_beam, int beam, int first, int rows, PressChunk& out) {
    const hn::RebindToSigned<D> di;
    const int line = first_beam + beam;
    const BetweenNodes<D> between(d, v, line);
    const bool dents = out.movers.needle;
    const int every = out.movers.pool_step;
    const bool gently = every > 1 && !dents, pushes = every > 0 && !gently;
    const bool still = gently && (!v.pressed || first > v.capacity);
    out.first = first;
    for (int row = still ? rows : -1; row < rows; ++row) {
        const int k = std::max(first + row, 0);
        const std::ptrdiff_t nodes = static_cast<std::ptrdiff_t>(k) * v.node_stride;
        auto along = hn::Zero(d), side = hn::Zero(d);
        if (v.pressed && k < v.capacity) {
            along = between(v.along.data() + nodes);
            if (row >= 0 || every > 0) side = between(v.side.data() + nodes);
        }
        if (dents || pushes) {
            const PlaceLanes<D> places = places_of_beams(d, v, line, k);
            ShiftLanes<D> shift{along, side};
            auto by = hn::Zero(d), aside = hn::Zero(d);
            if (dents && needle_lanes(d, v, places, by, aside))
                shift = shift_by_needle_and_probe(d, v, places);
            if (pushes) pool_lanes(d, v, places, shift);
            along = shift.along;
            side = shift.side;
        }
        hn::Store(along, d, out.along + (row + 1) * kPressBeams + beam);
        if (row >= 0) hn::Store(side, d, out.side + row * kPressBeams + beam);
    }
    if (gently) push_gently(d, v, line, beam, first, rows, every, still, out);
    out.any_closed = false;
    if (!v.pressed || !v.field->closed_marks().any) return;
    for (int row = 0; row < rows; ++row) {
        const auto along = hn::Load(d, out.along + (row + 1) * kPressBeams + beam),
                   side = hn::Load(d, out.side + row * kPressBeams + beam);
        auto closed = hn::Zero(di);
        if (may_close(v, first + row))
            closed = closed_lanes(d, v, places_of_beams(d, v, line, first + row), {along, side});
        hn::Store(closed, di, out.closed + row * kPressBeams + beam);
        out.any_closed = out.any_closed || !hn::AllTrue(di, hn::Eq(closed, hn::Zero(di)));
    }
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
