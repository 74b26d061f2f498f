// SPDX-License-Identifier: Apache-2.0

// Proof that the fitted map does not fold: a lower bound of det J over the whole CT box.
//
// In a cell of the residual's spline det J is a polynomial of degree at most 8 in each axis (3
// without a residual). Sampled at 9 (4) nodes per axis it is known exactly; in Bernstein form it
// lies above its least coefficient. Cells whose bound is loose are cut in eight and bounded again.
// What rounding can have done is subtracted. Cost: about 20 us a spline cell and core; below 1 ms
// without a residual.
#pragma once

#include "formats/registration/registration.h"

namespace sonocase::pipeline {

struct FoldProof {
    double least_bound = 0;   // det J >= this everywhere in ct_box
    double least_sample = 0;  // and somewhere it is this: the gap is what the bound gives away
};

// Demanded of every map that is handed out.
inline constexpr double kLeastDetJacobian = 0.2;

// registration.ct_box must not be empty.
FoldProof prove_no_fold(const Registration& registration);

}  // namespace sonocase::pipeline
