// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_face.h"

#include <cmath>

namespace sonocase::runtime::press {

BeamPoint beam_point(const PressFace& face, Point3 p) {
    if (face.radius_mm <= 0) return {p.x, p.z};
    const double along = p.z + face.radius_mm;
    return {face.radius_mm * std::atan2(p.x, along),
            std::sqrt(p.x * p.x + along * along) - face.radius_mm};
}

PressBeam press_beam(const PressFace& face, double lateral_mm) {
    if (face.radius_mm <= 0) return {{lateral_mm, 0, 0}, {0, 0, 1}};
    const double angle = lateral_mm / face.radius_mm, s = std::sin(angle), c = std::cos(angle);
    return {{face.radius_mm * s, 0, face.radius_mm * (c - 1)}, {s, 0, c}};
}

PressBeams::PressBeams(const PressFace& face) {
    for (std::size_t i = 0; i < kColumns; ++i) {
        const double lateral = column_lateral_mm(face, static_cast<double>(i));
        const double quarter = 0.25 * column_width_mm(face);
        middle[i] = press_beam(face, lateral);
        left[i] = press_beam(face, lateral - quarter);
        right[i] = press_beam(face, lateral + quarter);
    }
}

Point3 probe_point(const PressFace& face, BeamPoint b, double y) {
    const PressBeam beam = press_beam(face, b.lateral_mm);
    const Point3 p = beam.origin + b.depth_mm * beam.direction;
    return {p.x, y, p.z};
}

}  // namespace sonocase::runtime::press
