// SPDX-License-Identifier: Apache-2.0

// Proof that the fitted map does not fold: a lower bound of det J over the whole CT box.
//
// In a cell of the residual's spline det J is a polynomial of degree at most 8 in each axis (3
// without a residual). Samples at 9 (4) nodes per axis determine it exactly; in Bernstein form it
// is bounded by its least coefficient. Cells whose bound is loose are divided into eight and
// bounded again. A bound on the rounding errors is subtracted. Cost: about 20 us per spline cell on
// one core; below 1 ms without a residual.
#pragma once

#include "formats/registration/registration.h"

namespace sonocase::pipeline {

struct FoldProof {
    double least_bound = 0;   // det J >= this everywhere in ct_box
    double least_sample = 0;  // the least value found: the difference is the slack of the bound
};

// Required of every map that is returned.
inline constexpr double kLeastDetJacobian = 0.2;

// registration.ct_box must not be empty.
FoldProof prove_no_fold(const Registration& registration);

}  // namespace sonocase::pipeline
