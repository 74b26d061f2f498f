// SPDX-License-Identifier: Apache-2.0

// The press field along a stretch of a block of beams, in lanes. Included once per instruction set.
#include <hwy/highway.h>

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

// Sample k of the beams of a vector: PlaneShift, and the place at rest in columns.
template <class D>
struct PressLanes {
    hn::Vec<D> along, side, tilt, column;
};

// beam: of the picture, the vector's first.
template <class D>
HWY_INLINE PressLanes<D> press_lanes(D d, const PressView& v, int beam, int k) {
    const hn::RebindToSigned<D> di;
    constexpr float kPerRow = static_cast<float>(1 / (kBulgeEvery * kTableStep_mm));
    const float r = (static_cast<float>(k) + 0.5f) * v.step_mm;
    const float at = std::min(r * kPerRow, kBulgeRows - 1.0f);
    const int n = std::min(static_cast<int>(at), kBulgeRows - 2);
    const auto part = hn::Set(d, at - static_cast<float>(n));
    const float* node = v.bulge.data() + static_cast<std::ptrdiff_t>(n) * v.lines + beam;
    const auto above = hn::LoadU(d, node), below = hn::LoadU(d, node + v.lines);
    const auto sideways = hn::Mul(hn::Add(above, hn::Mul(part, hn::Sub(below, above))),
                                  hn::Set(d, v.share[static_cast<std::size_t>(k)]));
    const auto per_mm = hn::Set(d, v.columns_per_mm);
    const auto column =
        hn::Min(hn::Max(hn::Add(hn::LoadU(d, v.column.data() + beam), hn::Mul(sideways, per_mm)),
                        hn::Zero(d)),
                hn::Set(d, kColumns - 1.0f));
    const auto i = hn::Min(hn::ConvertTo(di, column), hn::Set(di, kColumns - 2));
    const auto left = hn::GatherIndex(d, v.shift_row(k), i),
               right = hn::GatherIndex(d, v.shift_row(k) + 1, i);
    const auto slope = hn::Sub(right, left);
    const auto deeper = hn::Add(left, hn::Mul(hn::Sub(column, hn::ConvertTo(d, i)), slope));
    const auto per_radius = hn::Set(d, v.per_radius_mm);
    const auto grow =
        hn::Add(hn::Set(d, 1.0f), hn::Mul(hn::Add(hn::Set(d, r), deeper), per_radius));
    const auto side = hn::Mul(sideways, grow);
    const auto turned = hn::Mul(hn::Mul(hn::Mul(hn::Set(d, 0.5f), sideways), per_radius), side);
    return {hn::Sub(deeper, turned), side, hn::Mul(slope, per_mm), column};
}

// Phased arrays, whose beams cross columns: sample by sample.
inline void press_crossing(const PressView& v, int beam, int lanes, int k, float* out) {
    for (int lane = 0; lane < lanes; ++lane) {
        const ScanGeometry& g = *v.geometry;
        const int line = std::min(beam + lane, g.scanlines - 1);
        const ScanGeometry::Beam& of = g.beams[static_cast<std::size_t>(line)];
        const double r = (k + 0.5) * g.step_mm;
        const PlaneShift s = plane_shift(*v.field, g, of, line, r);
        const BeamPoint shown{of.origin.x + r * of.direction.x, of.origin.z + r * of.direction.z};
        out[lane] = static_cast<float>(s.along_mm);
        out[kPressBeams + lane] = static_cast<float>(s.side_mm);
        out[2 * kPressBeams + lane] = v.field->closed_in_plane(shown) ? 1.0f : 0.0f;
    }
}

// Fills the lanes of one vector of beams. first_beam: of the block; beam: the vector's first within
// it; [first, first + rows): samples, all active.
template <class D>
HWY_NOINLINE void press_chunk(
    D d, const PressView& v, int first_beam, int beam, int first, int rows, PressChunk& out) {
    const hn::RebindToSigned<D> di;
    const int lanes = static_cast<int>(hn::Lanes(d)), line = first_beam + beam;
    const PressClosed& nodes = v.field->closed_nodes();
    out.first = first;
    out.any_closed = false;
    alignas(64) float crossing[3 * kPressBeams];
    const auto at = [&](int k) HWY_ATTR {
        if (v.columns_follow_beams) return press_lanes(d, v, line, k);
        press_crossing(v, line, lanes, k, crossing);
        return PressLanes<D>{hn::LoadU(d, crossing), hn::LoadU(d, crossing + kPressBeams),
                             hn::Zero(d), hn::LoadU(d, crossing + 2 * kPressBeams)};
    };
    const auto per_step = hn::Set(d, 1 / v.step_mm), one = hn::Set(d, 1.0f);
    auto before = at(first > 0 ? first - 1 : 0).along;
    for (int row = 0; row < rows; ++row) {
        const int k = first + row, to = row * kPressBeams + beam;
        const PressLanes<D> p = at(k);
        hn::Store(p.along, d, out.along + to);
        hn::Store(p.side, d, out.side + to);
        hn::Store(p.tilt, d, out.tilt + to);
        hn::Store(hn::Add(one, hn::Mul(hn::Sub(p.along, before), per_step)), d, out.rise + to);
        before = p.along;
        auto closed = hn::Zero(di);
        if (!v.columns_follow_beams) {
            closed = hn::ConvertTo(di, p.column);
        } else if (nodes.any) {
            const float r = (static_cast<float>(k) + 0.5f) * v.step_mm;
            constexpr float kPerStep = static_cast<float>(1 / kTableStep_mm);
            const int m = static_cast<int>(std::min(r * kPerStep, kTableRows - 1.0f) + 0.5f);
            if (nodes.row[static_cast<std::size_t>(m)])
                closed = hn::GatherIndex(di, nodes.row_of(m),
                                         hn::ConvertTo(di, hn::Add(p.column, hn::Set(d, 0.5f))));
        }
        hn::Store(closed, di, out.closed + to);
        out.any_closed = out.any_closed || !hn::AllTrue(di, hn::Eq(closed, hn::Zero(di)));
    }
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
