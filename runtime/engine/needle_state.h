// SPDX-License-Identifier: Apache-2.0

// The needle between tracker and picture: where it went through the skin, how deep it is, and the
// direction in which it is drawn.
//
// Every reading brings the calibrated tip and direction. Once the needle is through the skin, the
// bend constraint of [Magee] eqs. (16) and (17) applies: the drawn direction is blended towards the
// one held at entry, and the drawn shaft passes through the blend of the two skin points, so that a
// bent shaft moves the picture less the deeper the needle is. At depth 0 the drawn needle is the
// measured one; the change is continuous. Part of the portable core: constant memory, no
// allocation, no clock.
#pragma once

#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/insertion_detector.h"
#include "runtime/engine/needle_constraint.h"

namespace sonocase::runtime {

struct NeedleView {
    Rigid mannequin_from_drawn;  // origin at the drawn tip, z from hub to tip
    double depth_mm = 0;         // inserted length as measured; 0 outside
    bool inserted = false;
    InsertionChange change = InsertionChange::none;
};

NeedleConstraintOptions constraint_of(const NeedleModel& needle);

class NeedleState {
  public:
    // The anatomy must outlive the state; null: the needle is drawn as measured.
    NeedleState(const Anatomy* anatomy,
                const NeedleModel& needle,
                const InsertionOptions& options = {});

    // Another anatomy of the same body, as after a change of image model.
    void set_anatomy(const Anatomy* anatomy) { anatomy_ = anatomy; }

    // Takes one reading of the tracked needle. Not called for readings without a pose.
    NeedleView update(double time_s, const Rigid& mannequin_from_needle);

    const InsertionDetector& insertions() const { return detector_; }

  private:
    const Anatomy* anatomy_;
    NeedleConstraintOptions constraint_;
    double length_mm_;
    InsertionDetector detector_;
};

}  // namespace sonocase::runtime
