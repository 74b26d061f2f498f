// SPDX-License-Identifier: Apache-2.0

// The bend constraint: the deeper the needle, the less a bent shaft turns it in the picture.
#pragma once

#include "formats/base/geometry.h"

namespace sonocase::runtime {

struct NeedleConstraintOptions {
    double max_weight = 1.0;         // w_max, in [0, 1]; 0 switches the constraint off
    double steepness_per_mm = 0.06;  // alpha, > 0
    double midpoint_mm = 120.0;      // delta, >= 0: the depth at which half of w_max applies
};

// Needle direction to draw, steadied towards the direction held at skin entry.
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

}  // namespace sonocase::runtime
