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

HomeView home_view(const Box3& body, const Exercise& exercise, const BodyAxes& axes) {
    if (axes.known) {
        HomeView out;
        // As the patient is faced: the right side is on the left.
        out.home = Matrix3::from_columns(-axes.right, axes.head, axes.front);
        out.interest = body.centre() + 0.15 * (exercise.start_probe - body.centre());
        const Vector3 extent = body.extent();
        const double reach = 1.35 * std::max({extent.x, extent.y, extent.z, 100.0});
        out.orbit = orbit_towards(out.home, -exercise.start_beam, reach);
        // Beside the probe rather than along it, and a little from above.
        constexpr double kBesideRad = 0.45, kAboveRad = 0.22;
        out.orbit.yaw_rad += out.orbit.yaw_rad > 0 ? -kBesideRad : kBesideRad;
        out.orbit.pitch_rad = kAboveRad;
        return out;
    }
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

std::vector<CubeFace> cube_faces(const Matrix3& camera_from_mannequin, const BodyAxes& axes) {
    struct Side {
        const char* letter;
        Vector3 outward, across, along;
    };
    const Side sides[] = {
        {"R", axes.right, axes.front, axes.head}, {"L", -axes.right, axes.front, axes.head},
        {"A", axes.front, axes.right, axes.head}, {"P", -axes.front, axes.right, axes.head},
        {"H", axes.head, axes.right, axes.front}, {"F", -axes.head, axes.right, axes.front}};
    constexpr double kHalf = 0.57;  // so that a corner, at sqrt(3) of it, is within 1
    constexpr double kInSight = 0.02;
    std::vector<CubeFace> faces;
    for (const Side& side : sides) {
        const double towards = (camera_from_mannequin * side.outward).z;
        if (towards < kInSight) continue;
        CubeFace face{side.letter, {}, towards, side.outward};
        constexpr double kSigns[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
        for (int i = 0; i < 4; ++i) {
            const Vector3 p =
                camera_from_mannequin *
                (kHalf * (side.outward + kSigns[i][0] * side.across + kSigns[i][1] * side.along));
            face.corners[static_cast<std::size_t>(i)] = {p.x, p.y};
        }
        faces.push_back(face);
    }
    std::sort(faces.begin(), faces.end(),
              [](const CubeFace& a, const CubeFace& b) { return a.towards_eye < b.towards_eye; });
    return faces;
}

Orbit orbit_towards(const Matrix3& home, Vector3 outward, double distance_mm) {
    constexpr double kMaxPitchRad = 1.5;  // upright has no direction straight from above
    const double x = dot(home.column(0), outward), y = dot(home.column(1), outward),
                 z = dot(home.column(2), outward);
    Orbit orbit;
    orbit.yaw_rad = std::hypot(x, z) > 1e-3 ? std::atan2(x, z) : 0;
    orbit.pitch_rad = std::clamp(std::atan2(y, std::hypot(x, z)), -kMaxPitchRad, kMaxPitchRad);
    orbit.distance_mm = distance_mm;
    return orbit;
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
