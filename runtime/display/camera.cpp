// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/camera.h"

#include <cmath>

namespace sonocase::runtime {
namespace {

Rigid looking(Point3 eye, Point3 at, Vector3 up_hint) {
    const Vector3 back = normalized(eye - at);
    const Vector3 right = normalized(cross(up_hint, back));
    return {Matrix3::from_columns(right, cross(back, right), back), eye - Point3{}};
}

}  // namespace

Rigid mannequin_from_outside_camera(const Matrix3& home, Point3 interest, const Orbit& orbit) {
    const double cp = std::cos(orbit.pitch_rad);
    const Vector3 back = home * Vector3{std::sin(orbit.yaw_rad) * cp, std::sin(orbit.pitch_rad),
                                        std::cos(orbit.yaw_rad) * cp};
    return looking(interest + orbit.distance_mm * back, interest, home.column(1));
}

Rigid mannequin_from_probe_camera(const Rigid& mannequin_from_probe) {
    // From the side of +y the picture is the right way round: x to the right, depth downwards.
    const Point3 eye{0, 150, -70}, at{0, 0, 55};
    return looking(mannequin_from_probe * eye, mannequin_from_probe * at,
                   mannequin_from_probe.rotation * Vector3{0, 0, -1});
}

Rigid mannequin_from_needle_camera(const Rigid& mannequin_from_needle) {
    const Point3 eye{0, -16, -110}, at{0, 0, 30};
    return looking(mannequin_from_needle * eye, mannequin_from_needle * at,
                   mannequin_from_needle.rotation * Vector3{0, -1, 0});
}

}  // namespace sonocase::runtime
