// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/box_hands.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::doppler {
namespace {

// Part of the face and depth, as the settings have them.
struct FacePoint {
    double line = 0, depth_mm = 0;
};

PlanePoint plane_point(const ColourBox& box, FacePoint at) {
    return box.point(at.line * kColourLines - 0.5, at.depth_mm / box.row_mm - 0.5);
}

FacePoint face_point(const ScanGeometry& geometry, double steer_tan, PlanePoint p) {
    p.x -= p.z * steer_tan;  // 0 for a fan
    double line = 0, sample = 0;
    geometry.locate(p, line, sample);
    return {(line + 0.5) / geometry.scanlines, (sample + 0.5) * geometry.step_mm};
}

}  // namespace

std::vector<PlanePoint> box_outline(const ScanGeometry& geometry, const DopplerSettings& d) {
    constexpr int kSteps = 12;  // along the arcs of a fan
    const ColourBox box = colour_box(geometry, d);
    const auto line = [&](int i) { return d.box_left + (d.box_right - d.box_left) * i / kSteps; };
    std::vector<PlanePoint> points;
    for (int i = 0; i <= kSteps; ++i) points.push_back(plane_point(box, {line(i), d.box_top_mm}));
    for (int i = kSteps; i >= 0; --i)
        points.push_back(plane_point(box, {line(i), d.box_bottom_mm}));
    return points;
}

GateMarks gate_marks(const ScanGeometry& geometry, const DopplerSettings& d) {
    const ColourBox box = colour_box(geometry, d);
    const auto at = [&](double depth_mm) { return plane_point(box, {d.gate_line, depth_mm}); };
    return {at(0), at(geometry.depth_mm), at(d.gate_depth_mm - 0.5 * d.gate_mm),
            at(d.gate_depth_mm + 0.5 * d.gate_mm), at(d.gate_depth_mm)};
}

Held hold_at(const ScanGeometry& geometry,
             const DopplerSettings& d,
             PlanePoint at,
             double reach_mm) {
    if (d.mode == DopplerMode::off) return Held::none;
    const ColourBox box = colour_box(geometry, d);
    const auto near = [&](FacePoint mark, double reach) {
        const PlanePoint p = plane_point(box, mark);
        return std::hypot(p.x - at.x, p.z - at.z) <= reach;
    };
    const FacePoint pointer = face_point(geometry, box.steer_tan, at);
    if (d.mode == DopplerMode::m_mode)
        return near({d.gate_line, pointer.depth_mm}, reach_mm) ? Held::gate : Held::none;
    if (d.mode == DopplerMode::spectral)
        return near({d.gate_line, d.gate_depth_mm}, 2 * reach_mm) ? Held::gate : Held::none;
    if (near({d.box_right, d.box_bottom_mm}, reach_mm)) return Held::corner;
    const bool inside = pointer.line >= d.box_left && pointer.line <= d.box_right &&
                        pointer.depth_mm >= d.box_top_mm && pointer.depth_mm <= d.box_bottom_mm;
    return inside ? Held::box : Held::none;
}

void drag_held(const ScanGeometry& geometry,
               Held held,
               PlanePoint from_place,
               PlanePoint to_place,
               DopplerSettings& d) {
    constexpr double kMinLine = 0.08, kMinMm = 5;
    const double steer_tan = colour_box(geometry, d).steer_tan;
    const FacePoint from = face_point(geometry, steer_tan, from_place),
                    to = face_point(geometry, steer_tan, to_place);
    const double depth = geometry.depth_mm;
    switch (held) {
        case Held::none: return;
        case Held::gate:
            d.gate_line = std::clamp(to.line, 0.0, 1.0);
            if (d.mode == DopplerMode::spectral)
                d.gate_depth_mm = std::clamp(to.depth_mm, 1.0, depth);
            return;
        case Held::corner:
            d.box_right = std::clamp(to.line, std::min(d.box_left + kMinLine, 1.0), 1.0);
            d.box_bottom_mm =
                std::clamp(to.depth_mm, std::min(d.box_top_mm + kMinMm, depth), depth);
            return;
        case Held::box: break;
    }
    const double by_line = std::clamp(to.line - from.line, -d.box_left, 1 - d.box_right);
    const double by_mm = std::clamp(to.depth_mm - from.depth_mm, std::min(1 - d.box_top_mm, 0.0),
                                    std::max(depth - d.box_bottom_mm, 0.0));
    d.box_left += by_line;
    d.box_right += by_line;
    d.box_top_mm += by_mm;
    d.box_bottom_mm += by_mm;
}

}  // namespace sonocase::runtime::doppler
