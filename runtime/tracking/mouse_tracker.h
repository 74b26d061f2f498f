// SPDX-License-Identifier: Apache-2.0

// Mouse and keyboard as a tracker: a probe that stays on the skin, and a needle.
//
// The window turns input into the small movements below. Nothing here depends on a window, so that
// a test can move it as well. Distances are in mm and angles in radians; all in `mannequin`.
#pragma once

#include "formats/exercise/exercise.h"
#include "runtime/engine/skin.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking {

class MouseTracker final : public Tracker {
  public:
    // The probe starts at the exercise's place, moved onto the skin, or, if that misses the body,
    // at the point of the skin above the middle of the bundle.
    MouseTracker(const Skin& skin, const Exercise& exercise);

    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;

    // The probe. Sliding keeps the face on the skin and does not turn the probe about its beam.
    void slide(double lateral_mm, double elevation_mm);
    void rock(double angle_rad);    // in the scan plane, about the elevation axis
    void fan(double angle_rad);     // out of the scan plane, about the lateral axis
    void rotate(double angle_rad);  // about the beam
    void press(double mm);          // > 0 into the skin; a lifted probe comes down first
    // Onto the skin where the line from `near` meets it; false: no skin there.
    bool put_probe(Point3 near, Vector3 towards);
    void reset();

    // The needle. It is placed on a point of the skin, which stays its entry while it is aimed and
    // advanced.
    bool place_needle(Point3 near, Vector3 towards);
    // Beside the probe, `offset_mm` from the middle of the face along x (in plane) or along y.
    bool place_needle_beside_probe(double offset_mm, bool in_plane);
    // The same, just beside the probe's face.
    bool take_needle(const Probe& probe, bool in_plane);
    void aim_needle(double in_plane_rad, double out_of_plane_rad);  // about the probe's y and x
    // Turns the needle about its entry, so that pushed on it meets p. False: no needle, or p lies
    // outside the skin at the entry.
    bool aim_needle_at(Point3 p);
    void roll_needle(double angle_rad);  // about its axis; it is taken with the bevel to the probe
    void advance_needle(double mm);      // > 0 deeper; limited to [-60 mm, the needle's length]
    void slide_needle(double lateral_mm, double elevation_mm);  // only while it is not inserted
    void withdraw_needle();                                     // takes it away

    bool in_contact() const { return press_mm_ >= 0; }
    double press_mm() const { return press_mm_; }
    bool has_needle() const { return has_needle_; }
    double needle_depth_mm() const { return depth_mm_; }
    Point3 needle_entry() const { return entry_; }
    Rigid mannequin_from_probe() const;
    Rigid mannequin_from_needle() const;

  private:
    void move_contact(Point3 near);  // sets contact point and normal from a place near the skin

    Skin skin_;
    Point3 start_probe_;
    Vector3 start_beam_, start_lateral_;
    double needle_length_mm_;
    Point3 contact_;
    Vector3 normal_{0, 0, 1};   // outward
    Vector3 lateral_{1, 0, 0};  // in the skin's tangent plane, before rock and fan
    double rock_rad_ = 0, fan_rad_ = 0, press_mm_ = 1;
    bool has_needle_ = false;
    double roll_rad_ = 0;
    Point3 entry_;
    Vector3 shaft_{0, 0, -1};
    double depth_mm_ = 0;
    bool changed_ = true;
    std::uint64_t sequence_ = 0;
};

}  // namespace sonocase::runtime::inline tracking
