// SPDX-License-Identifier: Apache-2.0

// Proof that the fitted map is one to one on the whole CT box. det J > 0 excludes folds near each
// point only: a map that winds round itself passes it.
//
// Let R be the polar rotation of the mean Jacobian and S = sym(R^T J). If S is positive definite
// everywhere in the box, then (y(a) - y(b)) . R (a - b) > 0 for any two of its points, because the
// box is convex: no two points have one image. S is positive definite where its leading minors
//     S11,   S11 S22 - S12^2,   det S
// are positive: polynomials of degree 3, 6 and 9 along each axis of a spline cell. They are bounded
// through the 64 Bernstein coefficients of S itself, which are matrices: S is their convex
// combination, and on positive definite matrices the n-th root of a determinant of order n is
// concave (Minkowski), so each minor is at least its least value among the coefficients. Cells
// where a coefficient is not positive definite, or whose bound is loose, are cut into eight. Cost:
// some 10 us for each cell on one core.
#pragma once

#include <array>

#include "formats/registration/registration.h"

namespace sonocase::pipeline {

struct OneToOneProof {
    // S11, its 2 x 2 minor and det S are at least this everywhere in ct_box. -infinity: no bound.
    std::array<double, 3> least_bound{};
    std::array<double, 3> least_sample{};  // the least values found
    double least_minor() const;            // of least_bound
    bool proven() const { return least_minor() > 0; }
};

// registration.ct_box must not be empty.
OneToOneProof prove_one_to_one(const Registration& registration);

}  // namespace sonocase::pipeline
