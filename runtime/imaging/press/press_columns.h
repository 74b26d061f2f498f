// SPDX-License-Identifier: Apache-2.0

// From the stresses in the columns to where their tissue lies.
#pragma once

#include "runtime/imaging/press/press_elastic.h"

namespace sonocase::runtime::press {

struct PressColumns {
    Plane<kFineRows> stretch;         // pressed height over resting height of each part, > 0
    Plane<kFineRows> lumen;           // of what drains in it; rows of PressSamples::lumen alone
    Plane<kFineRows + 1> pressed_mm;  // depth from the face of each part's upper edge
    std::array<float, kColumns> factor{};  // that the stresses were multiplied by
    double force_n = 0;
};

// Stretches of every part by the laws of press_law.h. The stresses of a column under the face are
// multiplied by one factor (Newton), so that its stretches add up to what is pressed, and its
// heights by another, which makes that exact; both are near 1. A lumen of small stretch closes.
//
// Every stretch is positive, so depth rises along each column: it can be inverted. Force in
// newtons: F = sqrt(pi) h sum_i q_i over the columns that touch, q as in press_law.h. Cost: 15 us.
void stretch_columns(SimdTarget simd,
                     const PressSamples& samples,
                     const PressFace& face,
                     const PressElastic& elastic,
                     PressColumns& out);

}  // namespace sonocase::runtime::press
