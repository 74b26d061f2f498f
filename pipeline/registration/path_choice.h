// SPDX-License-Identifier: Apache-2.0

// Which displacement follows the quadratic: none, the residual warp or the elastic warp.
//
// The residual warp suffices if the readings end close to the skin, the map is proven free of folds
// and one to one, and bones and solid organs keep their volume. Otherwise the elastic warp is
// fitted, which takes the patient's tissues into account and closes some 50 mm. Where its proofs
// fail it is fitted again, stiffer; where no fit can be proven, or the bodies differ by more than
// it closes, the map falls back to the quadratic, and a warning says so.
#pragma once

#include <string>
#include <vector>

#include "pipeline/registration/elastic/elastic_warp.h"
#include "pipeline/registration/elastic/organ_change.h"
#include "pipeline/registration/map/one_to_one_proof.h"
#include "pipeline/registration/warp_fit.h"

namespace sonocase::pipeline {

// What the residual warp has to reach to be kept.
inline constexpr double kSufficientP95_mm = 3, kSufficientVolume = 0.08, kLeastOrgan_ml = 20;
// What a structure may change by before a warning says so.
inline constexpr double kVolumeTolerance = 0.1, kShapeTolerance = 0.2;

// Completes w: with the residual warp already in it where that was fitted. Sets its path, reason,
// one-to-one bounds, organs and warnings, and replaces its map where the elastic warp is taken.
void choose_path(const FitContext& s,
                 const RegisterOptions& options,
                 const Progress& progress,
                 WarpFit* w);

}  // namespace sonocase::pipeline
