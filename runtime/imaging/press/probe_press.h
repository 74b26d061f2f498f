// SPDX-License-Identifier: Apache-2.0

// A probe on the body of a bundle, frame after frame: where bone holds it, and how tissue yields.
#pragma once

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/press/press_bundle.h"
#include "runtime/imaging/press/press_field.h"

namespace sonocase::runtime::press {

// A face this far below the resting skin touches it and does not press yet: there is gel, and a
// bundle knows its skin, to which poses are snapped, only to a voxel. The field is solved for a
// face this much further out and holds for the face itself, so that pressing begins without a
// step.
inline constexpr double kTouchMm = 1;
inline constexpr double kMaxPressMm = 40;  // furthest that a probe is pressed beyond its pose

class ProbePress {
  public:
    // The bundle must outlive this object. Allocates; the rest of the class does not.
    ProbePress(const CaseView& bundle, const Exercise& exercise, SimdTarget simd);

    // Presses a face at the pose, press_mm deeper; a pose that stays is solved once. Returns the
    // pose at which bone holds the face, which is that of the picture.
    Rigid at(const Rigid& mannequin_from_probe, double press_mm);
    Rigid held_pose() const;  // what at() returned last
    // Another pressure in the veins for what follows; not above 0: the exercise's.
    void set_venous_pressure(double mmhg);
    // A needle that moves tissue, in the frame of the pose that at() returned.
    void dent(const NeedleDent& needle) { field_.dent(needle); }
    // Pools that move tissue, where they are now in the frame `mannequin`; those that are none are
    // left out.
    void set_pools(std::span<const SceneChange::Pool> pools);

    // The depth of pressing, [0, kMaxPressMm], at which the force is force_n. Solves at most six
    // times, beginning at start_mm.
    double press_mm_for(const Rigid& mannequin_from_probe, double force_n, double start_mm);

    // Null: nothing moves.
    const PressField* moving() const { return field_.moves() ? &field_ : nullptr; }
    PressReport report() const;
    // As moved by the probe alone, in the frame `mannequin`. Without pressing: the place itself,
    // and false.
    Point3 at_rest(Point3 now) const;
    Point3 current_position(Point3 rest) const;
    bool closed(Point3 rest) const;

  private:
    void press(const Rigid& pose);

    PressBundle body_;
    PressField field_;
    SimdTarget simd_;
    PressOptions options_;
    Rigid pose_, from_mannequin_;
    bool solved_ = false;
    double exercise_mmhg_ = 8, venous_mmhg_ = 8;
};

}  // namespace sonocase::runtime::press
