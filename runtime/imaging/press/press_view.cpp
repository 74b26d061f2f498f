// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_view.h"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "press_view.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// This comes after Highway's: it is included again for each instruction set.
#include "runtime/imaging/press/press_law-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 16>;

// Calls f(d, at) for groups of nodes, at the first of each; all instruction sets take the same
// nodes. As a rule the last node stands alone beyond a whole number of blocks of beams.
template <class F>
HWY_INLINE void for_nodes(const PressView& v, F&& f) {
    const Lanes d;
    const int whole = v.nodes % kPressBeams == 1
                          ? v.nodes - 1
                          : (v.nodes + kPressBeams - 1) / kPressBeams * kPressBeams;
    for (int at = 0; at < whole; at += static_cast<int>(hn::Lanes(d))) f(d, at);
    if (whole < v.nodes) f(hn::CappedTag<float, 1>(), whole);
}

// The sideways shift at the nodes' own columns.
void spread_bulge(const PressTable& table, PressView& v) {
    for_nodes(v, [&](auto d, int at) HWY_ATTR {
        const hn::RebindToSigned<decltype(d)> di;
        const auto column = hn::LoadU(d, v.column.data() + at);
        const auto i = hn::Min(hn::ConvertTo(di, column), hn::Set(di, kColumns - 2));
        const auto part = hn::Sub(column, hn::ConvertTo(d, i));
        for (int n = 0; n < kBulgeRows; ++n) {
            const float* row = table.bulge_mm.row(n);
            const auto left = hn::GatherIndex(d, row, i), right = hn::GatherIndex(d, row + 1, i);
            const auto shift = mix(d, left, right, part);
            hn::StoreU(hn::Neg(shift), d,
                       v.bulge.data() + static_cast<std::ptrdiff_t>(n) * v.node_stride + at);
        }
    });
}

// PlaneShift at every node.
void spread(const PressTable& table, PressView& v) {
    spread_bulge(table, v);
    const Lanes columns;
    constexpr float kPerStep = static_cast<float>(1 / kTableStepMm);
    constexpr float kPerRow = static_cast<float>(1 / (kBulgeEvery * kTableStepMm));
    alignas(64) float deeper_row[kColumns];  // depth at rest less depth shown
    const auto still_mm = hn::Set(columns, 0.5f * kStillMm);
    std::array<std::uint8_t, kBulgeRows + 1> bulge_moves{};
    for (int n = 0; n < kBulgeRows; ++n)
        for_columns(columns, [&](int i) HWY_ATTR {
            const auto shift = hn::Abs(hn::LoadU(columns, table.bulge_mm.row(n) + i));
            if (!hn::AllTrue(columns, hn::Lt(shift, still_mm))) bulge_moves[n] = 1;
        });
    v.moving = 0;
    for (int k = 0; k < v.capacity; ++k) {
        const float r = (static_cast<float>(k) + 0.5f) * v.step_mm;
        const float share = v.share[k];
        const float table_row = std::min(r * kPerStep, kTableRows - 1.0f);
        const int m = std::min(static_cast<int>(table_row), kTableRows - 2);
        const auto below_row = hn::Set(columns, table_row - static_cast<float>(m));
        const auto depth = hn::Set(columns, table_row * static_cast<float>(kTableStepMm));
        bool still = true;  // every column
        for_columns(columns, [&](int i) HWY_ATTR {
            const auto upper = hn::LoadU(columns, table.rest_mm.row(m) + i);
            const auto lower = hn::LoadU(columns, table.rest_mm.row(m + 1) + i);
            const auto rest = mix(columns, upper, lower, below_row);
            const auto deeper = hn::Mul(hn::Set(columns, share), hn::Sub(rest, depth));
            still = still && hn::AllTrue(columns, hn::Lt(hn::Abs(deeper), still_mm));
            hn::Store(deeper, columns, deeper_row + i);
        });
        const float bulge_row = std::min(r * kPerRow, kBulgeRows - 1.0f);
        const int n = std::min(static_cast<int>(bulge_row), kBulgeRows - 2);
        const float part = bulge_row - static_cast<float>(n);
        const float* bulge = v.bulge.data() + static_cast<std::ptrdiff_t>(n) * v.node_stride;
        const std::ptrdiff_t to = static_cast<std::ptrdiff_t>(k) * v.node_stride;
        bool moves = false;
        if (still && bulge_moves[n] == 0 && bulge_moves[n + 1] == 0) {
            for (auto* plane : {&v.along, &v.side, &v.tilt})
                std::fill_n(plane->begin() + to, v.node_stride, 0.0f);
            continue;
        }
        for_nodes(v, [&](auto d, int at) HWY_ATTR {
            const hn::RebindToSigned<decltype(d)> di;
            const auto per_mm = hn::Set(d, v.columns_per_mm),
                       per_radius = hn::Set(d, v.per_radius_mm);
            const auto above = hn::LoadU(d, bulge + at),
                       below = hn::LoadU(d, bulge + v.node_stride + at);
            const auto sideways =
                hn::Mul(mix(d, above, below, hn::Set(d, part)), hn::Set(d, share));
            const auto column = hn::Min(
                hn::Max(hn::Add(hn::LoadU(d, v.column.data() + at), hn::Mul(sideways, per_mm)),
                        hn::Zero(d)),
                hn::Set(d, kColumns - 1.0f));
            const auto i = hn::Min(hn::ConvertTo(di, column), hn::Set(di, kColumns - 2));
            const auto left = hn::GatherIndex(d, deeper_row, i),
                       right = hn::GatherIndex(d, deeper_row + 1, i);
            const auto slope = hn::Sub(right, left);
            const auto deeper = hn::Add(left, hn::Mul(hn::Sub(column, hn::ConvertTo(d, i)), slope));
            // The beam turns by a small angle, as in plane_shift().
            const auto grow =
                hn::Add(hn::Set(d, 1.0f), hn::Mul(hn::Add(hn::Set(d, r), deeper), per_radius));
            const auto side = hn::Mul(sideways, grow);
            const auto turned =
                hn::Mul(hn::Mul(hn::Mul(hn::Set(d, 0.5f), sideways), per_radius), side);
            const auto shift = hn::Sub(deeper, turned);
            const auto farther = hn::Max(hn::Abs(shift), hn::Abs(side));
            moves = moves || !hn::AllTrue(d, hn::Lt(farther, hn::Set(d, kStillMm)));
            hn::StoreU(shift, d, v.along.data() + to + at);
            hn::StoreU(side, d, v.side.data() + to + at);
            hn::StoreU(hn::Mul(slope, per_mm), d, v.tilt.data() + to + at);
        });
        if (moves) v.moving = k + 1;
    }
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(spread);

PressView::PressView(const ScanGeometry& g, const PressFace& face)
    : geometry(&g),
      columns_follow_beams(follows_columns(g)),
      lines((g.scanlines + kPressBeams - 1) / kPressBeams * kPressBeams),
      step_mm(static_cast<float>(g.step_mm)),
      columns_per_mm(static_cast<float>(1 / column_width_mm(face))),
      per_radius_mm(g.fan && g.radius_mm > 0 ? static_cast<float>(1 / g.radius_mm) : 0.0f) {
    constexpr double kDeepestMm = (kTableRows - 1) * kTableStepMm + kTableFadeMm;
    constexpr double kMaxColumns = 0.7;  // distance of nodes
    const int deepest = static_cast<int>(kDeepestMm / g.step_mm + 0.5) + 1;
    capacity = active = std::min(g.samples, (deepest + kPressRows - 1) / kPressRows * kPressRows);
    const double beams_per_column = g.scanlines / static_cast<double>(kFaceColumns);
    for (const int each : {2, 4})
        if (each <= kMaxColumns * beams_per_column) every = each;
    every_log2 = every / 2;  // true for 1, 2 and 4
    for (int n = 0; n < kPressBeams + 4; ++n) {
        node_of[n] = n / every;
        part_of[n] = static_cast<float>(n % every) / static_cast<float>(every);
    }
    // The last node lies beyond the last beam, and a vector may be read from it.
    nodes = lines / every + 1;
    node_stride = (nodes + 15) / 16 * 16;
    for (auto* plane : {&along, &side, &tilt}) plane->assign(capacity * node_stride + 32, 0.0f);
    bulge.assign(kBulgeRows * node_stride, 0.0f);
    for (int node = 0; node < node_stride; ++node) {
        const double lateral = columns_follow_beams ? lateral_of_line(g, node * every) : 0;
        const double at = lateral / column_width_mm(face) + (kColumns - 1) / 2.0;
        column.push_back(static_cast<float>(std::clamp(at, 0.0, kColumns - 1.0)));
    }
    for (int k = 0; k < capacity; ++k) {
        const double beyond =
            std::max(0.0, (k + 0.5) * g.step_mm - (kTableRows - 1) * kTableStepMm);
        share.push_back(static_cast<float>(std::max(0.0, 1 - beyond / kTableFadeMm)));
    }
    if (columns_follow_beams) {
        const double width = column_width_mm(face);
        first_column = static_cast<float>(lateral_of_line(g, 0) / width + (kColumns - 1) / 2.0);
        columns_per_line =
            static_cast<float>((lateral_of_line(g, 1) - lateral_of_line(g, 0)) / width);
    }
    beams.resize(4 * static_cast<std::size_t>(lines));
    for (int l = 0; l < lines; ++l) {
        const PlanePoint o = g.beam_origin(l), n = g.beam_direction(l);
        std::size_t row = 0;
        for (const double number : {o.x, o.z, n.x, n.z})
            beams[row++ * static_cast<std::size_t>(lines) + static_cast<std::size_t>(l)] =
                static_cast<float>(number);
    }
}

PressView::Shift PressView::at(int line, int k) const {
    const auto exact = [&](PlaneShift s) {
        return Shift{static_cast<float>(s.along_mm), static_cast<float>(s.side_mm)};
    };
    const int l = std::min(line, geometry->scanlines - 1);
    const ScanGeometry::Beam& beam = geometry->beams[l];
    const double r = (k + 0.5) * geometry->step_mm;
    if (field->needle().moves()) {
        const Point3 p{beam.origin.x + r * beam.direction.x, 0,
                       beam.origin.z + r * beam.direction.z};
        const Vector3 away = p - field->needle().tip;
        if (dot(away, away) < kDentReachMm * kDentReachMm)
            return exact(plane_shift(*field, *geometry, beam, l, r));
    }
    const Shift probe = by_probe(line, k);
    if (field->pools().empty()) return probe;
    PlaneShift s{double{probe.along_mm}, double{probe.side_mm}, 0};
    shift_by_pools(field->pools(), beam, r, s);
    return exact(s);
}

PressMovers PressView::movers(int line, int first, int rows) const {
    PressMovers m;
    if (first >= active) return m;
    m.probe = pressed;
    const NeedleDent& needle = field->needle();
    if (!needle.moves() && field->pools().empty()) return m;
    // A circle, in the plane, around the stretch.
    const auto corner = [&](int l, int k) {
        const auto at = static_cast<std::size_t>(std::min(l, lines - 1));
        const double r = (k + 0.5) * double{step_mm};
        const auto number = [&](int row) { return double{beam_row(row)[at]}; };
        return Point3{number(0) + r * number(2), 0, number(1) + r * number(3)};
    };
    const Point3 middle = corner(line + kPressBeams / 2, first + rows / 2);
    double reach2 = 0;
    for (const int l : {line, line + kPressBeams - 1}) {
        for (const int k : {first, first + rows - 1}) {
            const Vector3 away = corner(l, k) - middle;
            reach2 = std::max(reach2, dot(away, away));
        }
    }
    const double reach_mm = std::sqrt(reach2);
    m.needle = needle.moves() && norm(needle.tip - middle) < reach_mm + kDentReachMm;
    m.pool_step = pool_step(middle, reach_mm);
    return m;
}

int PressView::pool_step(Point3 middle, double reach_mm) const {
    const double mm = double{step_mm};
    // The place that a pool moves has been moved by probe, needle and the pools before.
    const double moved = field->farthest_mm();
    bool any = false;
    int step = kPressRows;
    for (const SceneChange::Pool& pool : field->pools()) {
        const double radius = pool.radius_mm, away = norm(pool.centre - middle);
        if (away >= reach_mm + moved + kPoolReaches * radius) continue;
        any = true;
        // Within the pool the shift is linear. Outside it is (1 - k^3) R^3 / 3 r^2, whose second
        // derivative d leaves a line over h by d h^2 / 8.
        const double by_others = moved - (1 - kPoolCore) * radius;
        for (; step > 1; step = step > 4 ? step / 2 : 1) {
            const double h = step * mm, near = reach_mm + h + by_others;
            const double from = std::max(
                radius, std::sqrt(std::sqrt(h * h * radius * radius * radius / (4 * kPoolOffMm))));
            if (away + near <= radius || away - near >= from) break;
        }
    }
    return any ? step : 0;
}

// Fills the planes for phased arrays, whose beams cross columns: every other sample of the nodes is
// worked out one by one.
void PressView::cross_columns() {
    const ScanGeometry& g = *geometry;
    moving = capacity;
    for (int k = 0; k < capacity; k += 2) {
        for (int node = 0; node < nodes; ++node) {
            const PlanePoint o = g.beam_origin(node * every), d = g.beam_direction(node * every);
            const PlanePoint n = beside(d);
            const double r = (k + 0.5) * g.step_mm;
            const PlanePoint p{o.x + r * d.x, o.z + r * d.z};
            const RestPlace rest = field->pressed_in_plane({p.x, p.z});
            const double x = rest.lateral_mm - p.x, z = rest.depth_mm - p.z;
            const int to = k * node_stride + node;
            along[to] = static_cast<float>(x * d.x + z * d.z);
            side[to] = static_cast<float>(x * n.x + z * n.z);
        }
    }
    for (int k = 1; k < capacity; k += 2) {
        const float* a = along.data() + static_cast<std::ptrdiff_t>(k - 1) * node_stride;
        const float* s = side.data() + static_cast<std::ptrdiff_t>(k - 1) * node_stride;
        const std::ptrdiff_t next = k + 1 < capacity ? 2 * node_stride : 0;
        const std::ptrdiff_t to = static_cast<std::ptrdiff_t>(k) * node_stride;
        for (int node = 0; node < nodes; ++node) {
            along[to + node] = 0.5f * (a[node] + a[next + node]);
            side[to + node] = 0.5f * (s[node] + s[next + node]);
        }
    }
}

void PressView::show(SimdTarget simd, const PressField& now) {
    field = &now;
    pressed = now.state().pressed;
    if (pressed && !(shown_ == &now && version_ == now.version())) {
        shown_ = &now;
        version_ = now.version();
        if (columns_follow_beams) {
            HWY_DISPATCH_TABLE(spread)[simd.index](now.table(), *this);
        } else {
            cross_columns();
        }
    }
    active = std::min(capacity, (moving + kPressRows - 1) / kPressRows * kPressRows);
    if (!pressed) active = 0;
    // A needle and a pool may move any sample.
    if (now.needle().moves() || !now.pools().empty()) active = geometry->samples;
}

}  // namespace sonocase::runtime::press
#endif
