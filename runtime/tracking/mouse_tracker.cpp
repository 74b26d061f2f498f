// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/mouse_tracker.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "runtime/tracking/scripted_sweep.h"

namespace sonocase::runtime::inline tracking {
namespace {

constexpr double kMaxTilt = 1.2;      // rad; beyond it the edge of a real face leaves the skin
constexpr double kMaxPress = 12;      // mm
constexpr double kLiftedHeight = 25;  // mm above the skin
constexpr double kReach = 80;         // mm searched for skin
constexpr double kNeedleHover = 60;   // mm that a needle can be held back from the skin

}  // namespace

MouseTracker::MouseTracker(const Skin& skin, const Exercise& exercise)
    : skin_(skin),
      start_probe_(exercise.start_probe),
      start_beam_(start_pose(exercise).rotation.column(2)),
      start_lateral_(start_pose(exercise).rotation.column(0)),
      needle_length_mm_(exercise.needle.length_mm) {
    reset();
}

void MouseTracker::reset() {
    rock_rad_ = fan_rad_ = 0;
    press_mm_ = 1;
    has_needle_ = false;
    contact_ = start_probe_;
    changed_ = true;
    normal_ = -start_beam_;
    lateral_ = start_lateral_;
    // A start outside the body or deep inside it is moved onto the skin: the search along the beam
    // goes farther until it meets the skin.
    if (put_probe(start_probe_, start_beam_)) return;
    for (double reach : {2 * kReach, 5 * kReach}) {
        if (const auto touch = skin_.project(start_probe_, start_beam_, reach)) {
            move_contact(*touch);
            break;
        }
    }
}

void MouseTracker::move_contact(Point3 near) {
    const Vector3 normal = skin_.normal(near);
    contact_ = near;
    if (norm(normal) > 0.5) {
        // Half way to the new normal: a ridge of one voxel must not make the probe jump.
        normal_ = normalized(normal_ + normal);
        if (norm(normal_) < 0.5) normal_ = normal;
    }
    const Vector3 tangent = lateral_ - dot(lateral_, normal_) * normal_;
    lateral_ = norm(tangent) > 1e-6 ? normalized(tangent) : any_perpendicular(normal_);
    changed_ = true;
}

bool MouseTracker::put_probe(Point3 near, Vector3 towards) {
    const auto touch = skin_.project(near, normalized(towards), kReach);
    if (!touch) return false;
    const Vector3 normal = skin_.normal(*touch);
    if (norm(normal) > 0.5) normal_ = normal;
    move_contact(*touch);
    return true;
}

void MouseTracker::slide(double lateral_mm, double elevation_mm) {
    // In steps shorter than the width of a rib, so that a fast mouse does not jump over a fold.
    const double length = std::hypot(lateral_mm, elevation_mm);
    const int steps = std::clamp(static_cast<int>(std::ceil(length / 3)), 1, 200);
    for (int i = 0; i < steps; ++i) {
        const Vector3 elevation = cross(-normal_, lateral_);
        const Point3 next =
            contact_ + (1.0 / steps) * (lateral_mm * lateral_ + elevation_mm * elevation);
        const auto touch = skin_.project(next, -normal_, 12);
        // The probe stops at the edge of the body or of the volume.
        if (!touch || (skin_.at_border(*touch) && !skin_.at_border(contact_))) return;
        move_contact(*touch);
    }
}

void MouseTracker::rock(double angle_rad) {
    rock_rad_ = std::clamp(rock_rad_ + angle_rad, -kMaxTilt, kMaxTilt);
    changed_ = true;
}

void MouseTracker::fan(double angle_rad) {
    fan_rad_ = std::clamp(fan_rad_ + angle_rad, -kMaxTilt, kMaxTilt);
    changed_ = true;
}

void MouseTracker::rotate(double angle_rad) {
    lateral_ = normalized(rotation_about(-normal_, angle_rad) * lateral_);
    changed_ = true;
}

void MouseTracker::press(double mm) {
    press_mm_ = std::clamp(press_mm_ + mm, -kLiftedHeight, kMaxPress);
    changed_ = true;
}

Rigid MouseTracker::mannequin_from_probe() const {
    // Rock and fan turn the probe about the point where its face meets the skin.
    const Matrix3 upright = Matrix3::from_columns(lateral_, cross(-normal_, lateral_), -normal_);
    const Matrix3 tilt = rotation_about({0, 1, 0}, rock_rad_) * rotation_about({1, 0, 0}, fan_rad_);
    const Point3 face = contact_ - press_mm_ * normal_;
    return {upright * tilt, {face.x, face.y, face.z}};
}

bool MouseTracker::place_needle(Point3 near, Vector3 towards) {
    const auto touch = skin_.project(near, normalized(towards), kReach);
    if (!touch) return false;
    const Vector3 normal = skin_.normal(*touch);
    entry_ = *touch;
    shaft_ = norm(normal) > 0.5 ? -normal : normalized(towards);
    depth_mm_ = -5;
    roll_rad_ = 0;
    has_needle_ = true;
    changed_ = true;
    return true;
}

bool MouseTracker::place_needle_beside_probe(double offset_mm, bool in_plane) {
    const Rigid probe = mannequin_from_probe();
    const Vector3 side = probe.rotation.column(in_plane ? 0 : 1);
    const Vector3 beam = probe.rotation.column(2);
    if (!place_needle(contact_ + offset_mm * side, -normal_)) return false;
    // Towards the middle of the picture at a depth of one and a half offsets, where a hand would
    // aim.
    shaft_ = normalized(1.5 * std::abs(offset_mm) * beam - offset_mm * side);
    return true;
}

bool MouseTracker::take_needle(const Probe& probe, bool in_plane) {
    // So far from the probe that the hand does not touch it.
    const double half = half_face_mm(probe);
    return place_needle_beside_probe(in_plane ? half + 8 : 18, in_plane);
}

void MouseTracker::aim_needle(double in_plane_rad, double out_of_plane_rad) {
    if (!has_needle_) return;
    const Rigid probe = mannequin_from_probe();
    const Matrix3 turn = rotation_about(probe.rotation.column(1), in_plane_rad) *
                         rotation_about(probe.rotation.column(0), out_of_plane_rad);
    shaft_ = normalized(turn * shaft_);
    changed_ = true;
}

bool MouseTracker::aim_needle_at(Point3 p) {
    const Vector3 way = p - entry_;
    if (!has_needle_ || dot(way, -normal_) <= 0) return false;
    shaft_ = normalized(way);
    changed_ = true;
    return true;
}

void MouseTracker::roll_needle(double angle_rad) {
    if (!has_needle_) return;
    roll_rad_ = std::remainder(roll_rad_ + angle_rad, 2 * kPi);
    changed_ = true;
}

void MouseTracker::advance_needle(double mm) {
    if (!has_needle_) return;
    depth_mm_ = std::clamp(depth_mm_ + mm, -kNeedleHover, needle_length_mm_);
    changed_ = true;
}

void MouseTracker::slide_needle(double lateral_mm, double elevation_mm) {
    if (!has_needle_ || depth_mm_ > 0) return;
    const Rigid probe = mannequin_from_probe();
    const Point3 next =
        entry_ + lateral_mm * probe.rotation.column(0) + elevation_mm * probe.rotation.column(1);
    if (const auto touch = skin_.project(next, -normal_, kReach)) entry_ = *touch;
    changed_ = true;
}

void MouseTracker::withdraw_needle() {
    has_needle_ = false;
    changed_ = true;
}

Rigid MouseTracker::mannequin_from_needle() const {
    const Vector3 to_probe = -mannequin_from_probe().rotation.column(2);
    Rigid needle = frame_along(entry_ + depth_mm_ * shaft_, shaft_, to_probe);
    needle.rotation = needle.rotation * rotation_about({0, 0, 1}, roll_rad_);
    return needle;
}

bool MouseTracker::poll(double now_s, TrackerReading& reading) {
    if (!changed_) return false;
    changed_ = false;
    reading = {};
    reading.sequence = ++sequence_;
    reading.time_s = now_s;
    reading.in_mannequin = true;
    reading.sensor_count = 2;
    reading.sensors[kProbeSensor] = {SensorState::ok, mannequin_from_probe(), 1.0f, 0};
    if (has_needle_) {
        reading.sensors[kNeedleSensor] = {SensorState::ok, mannequin_from_needle(), 1.0f, 0};
    }
    return true;
}

TrackerHealth MouseTracker::health() const {
    TrackerHealth health;
    health.phase = TrackerPhase::streaming;
    health.device = "Mouse and keyboard";
    health.readings = sequence_;
    return health;
}

}  // namespace sonocase::runtime::inline tracking
