// SPDX-License-Identifier: Apache-2.0

// What the readings leave open inside the body, structure by structure, told in two ways that know
// nothing of each other:
//
//   covariance  maps drawn from the posterior of the quadratic (Gauss-Newton, trust_quadratic), and
//               what the displacement after it moves
//   refits      the whole fit from the rigid pose on, repeated on halves of the readings that are
//               drawn block by block (60 mm cubes), with landmarks and the head's direction moved
//               by their own errors. The spread of such halves is that of a block bootstrap
//               (McCarthy 1969), without its repeated readings.
//
// To both is added what the map does beyond a rigid motion: the skin does not tell whether organs
// follow it. The larger of the two is said. Cost: `refits` times a second of one core for 2,000
// readings.
#pragma once

#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/registration/fit_context.h"
#include "pipeline/registration/warp_fit.h"

namespace sonocase::pipeline::inline registration {

// Landmarks are weighted by their evidence relative to that of the readings.
double landmark_weight(const QuadraticTrust& trust, double landmark_mm);

// Sets w->unknown, w->displaced_mm and, where no landmark is given, w->with_landmarks_mm.
// judged  the map that w->trust is of
void find_unknown(const FitContext& s,
                  const Rigid& rigid,
                  const RigidQuadratic& judged,
                  const RegisterOptions& options,
                  const Progress& progress,
                  WarpFit* w);

}  // namespace sonocase::pipeline::inline registration
