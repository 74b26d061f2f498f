// SPDX-License-Identifier: Apache-2.0

// What the readings leave open inside the body, structure by structure, told in two ways that know
// nothing of each other:
//
//   covariance  maps drawn from the posterior of the quadratic (Gauss-Newton, trust_quadratic),
//               their spread times beyond_quadratic
//   refits      the whole fit from the rigid pose on, repeated on halves of the readings that are
//               drawn block by block (60 mm cubes), with landmarks and the head's direction moved
//               by their own errors. The spread of such halves is that of a block bootstrap
//               (McCarthy 1969), without its repeated readings.
//
// To each is added what the displacement after the quadratic moves: a body can be read either way,
// with it or without; and, where the body has slid off its readings, how far they lie from it. The
// larger of the two is said. Cost: `refits` times a second of one core for
// 2,000 readings.
#pragma once

#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/registration/fit_context.h"
#include "pipeline/registration/warp_fit.h"

namespace sonocase::pipeline::inline registration {

// Landmarks are weighted by their evidence relative to that of the readings.
double landmark_weight(const QuadraticTrust& trust, double landmark_mm);

// By how much farther than the posterior of the quadratic the truth lies, 1 or more. Where a
// quadratic is true the gaps that it leaves are noise, and those of neighbours have nothing in
// common (design effect 1): the posterior holds. A mannequin of another build leaves gaps that go
// together patch by patch; its slopes are then some three times the `strain` that a quadratic is
// expected to have, and as the posterior's spread is in proportion to that, so is its factor:
//
//   sqrt(1 + 3^2 e / (e + 1)),  e = max(0, design effect - 1)
//
// Calibrated on known maps of three bodies, judged on others (fit_unknown_test.cpp,
// docs/numerics.md).
double beyond_quadratic(const QuadraticTrust& trust);

// Sets w->unknown, w->inside_mm and, where no landmark is given, w->with_landmarks_mm.
// judged  the map that w->trust is of
void find_unknown(const FitContext& s,
                  const Rigid& rigid,
                  const RigidQuadratic& judged,
                  const RegisterOptions& options,
                  const Progress& progress,
                  WarpFit* w);

}  // namespace sonocase::pipeline::inline registration
