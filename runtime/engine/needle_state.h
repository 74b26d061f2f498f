// SPDX-License-Identifier: Apache-2.0

// The needle between tracker and picture: where it went through the skin, how deep it is, and the
// direction in which it is drawn.
//
// Every reading brings the calibrated tip and direction. Once the needle is through the skin, the
// bend constraint of [Magee] eqs. (16) and (17) applies: the deeper the needle, the less a bent
// shaft turns it in the picture. The drawn direction is a blend of the measured one and the one
// held at entry, and the drawn shaft passes through the blend of the two skin points. At depth 0
// the drawn needle is the measured one; the change is continuous. Part of the portable core:
// constant memory, no allocation, no clock.
#pragma once

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/insertion_detector.h"

namespace sonocase::runtime::inline engine {

struct NeedleConstraintOptions {
    double max_weight = 1.0;         // w_max, in [0, 1]; 0 switches the constraint off
    double steepness_per_mm = 0.06;  // alpha, > 0
    double midpoint_mm = 120.0;      // delta, >= 0: the depth at which half of w_max applies
};

// Needle direction to draw: the measured one, drawn towards the direction held at skin entry.
//
//     d = w(l) * entry + (1 - w(l)) * measured,   w(l) = w_max / (1 + exp(-alpha (l - delta)))
//
// entry_world, measured_world  unit vectors
// depth_mm                     inserted length l; below 0 counts as 0
// returns                      unit vector
//
// Source: [Magee] eqs. (16)-(17). Departures: the blend is normalised (the paper does not say); the
// printed alpha = 60 and delta = 0.12 are per metre and metres.
// Hard case: opposite directions have no blend; measured_world is returned.
// Cost: constant, no allocation, cannot fail; meant for the frame loop.
Vector3 constrain_needle_direction(Vector3 entry_world,
                                   Vector3 measured_world,
                                   double depth_mm,
                                   const NeedleConstraintOptions& options = {});

// w(l) of eq. (17).
double needle_constraint_weight(double depth_mm, const NeedleConstraintOptions& options = {});

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

    // Takes another anatomy of the same body, as after a change of image model.
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

}  // namespace sonocase::runtime::inline engine
