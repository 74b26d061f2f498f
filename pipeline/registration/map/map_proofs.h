// SPDX-License-Identifier: Apache-2.0

// Proofs that the fitted map does not fold and that it is one to one.
//
// It does not fold: a lower bound of det J over the whole CT box.
//
// In a cell of the residual's spline det J is a polynomial of degree at most 8 in each axis (3
// without a residual). Samples at 9 (4) nodes per axis determine it exactly; in Bernstein form it
// is bounded by its smallest coefficient. Cells whose bound is loose are divided into eight and
// bounded again. A bound on the rounding errors is subtracted. Cost: about 20 us per spline cell on
// one core; below 1 ms without a residual.
#pragma once

#include <array>

#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_map {

struct FoldProof {
    double min_bound = 0;   // det J >= this everywhere in ct_box
    double min_sample = 0;  // the smallest value found: the difference is the slack of the bound
};

// Required of every map that is returned.
inline constexpr double kMinDetJacobian = 0.2;

// registration.ct_box must not be empty.
FoldProof prove_no_fold(const Registration& registration);

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
// concave (Minkowski), so each minor is at least its smallest value among the coefficients. Cells
// where a coefficient is not positive definite, or whose bound is loose, are cut into eight. Cost:
// some 10 us for each cell on one core.

struct OneToOneProof {
    // S11, its 2 x 2 minor and det S are at least this everywhere in ct_box. -infinity: no bound.
    std::array<double, 3> min_bound{};
    std::array<double, 3> min_sample{};  // the smallest values found
    double min_minor() const;            // of min_bound
    bool proven() const { return min_minor() > 0; }
};

// registration.ct_box must not be empty.
OneToOneProof prove_one_to_one(const Registration& registration);

}  // namespace sonocase::pipeline::inline registration_map
