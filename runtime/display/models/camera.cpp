// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/models/camera.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::inline display_models {
namespace {

Rigid looking(Point3 eye, Point3 at, Vector3 up_hint) {
    const Vector3 back = normalized(eye - at);
    const Vector3 right = normalized(cross(up_hint, back));
    return {Matrix3::from_columns(right, cross(back, right), back), eye - Point3{}};
}

}  // namespace

HomeView home_view(const Box3& body, const Exercise& exercise) {
    // The probe looks down in the picture, whatever the mannequin's axes are called; the body's
    // long axis runs across, as when a patient lies in front of an operator.
    const Vector3 up = normalized(-exercise.start_beam);
    const Vector3 extent = body.extent();
    Vector3 along{1, 0, 0};
    if (extent.y > extent.x && extent.y >= extent.z) along = {0, 1, 0};
    if (extent.z > extent.x && extent.z > extent.y) along = {0, 0, 1};
    Vector3 right = along - dot(along, up) * up;
    right = norm(right) > 0.3 ? normalized(right) : any_perpendicular(up);
    HomeView out;
    out.home = Matrix3::from_columns(right, up, cross(right, up));
    out.interest = body.centre() + 0.3 * (exercise.start_probe - body.centre());
    out.orbit.distance_mm = 1.55 * std::max({extent.x, extent.y, extent.z, 100.0});
    return out;
}

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

}  // namespace sonocase::runtime::inline display_models
