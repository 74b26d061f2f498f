// SPDX-License-Identifier: Apache-2.0

// Reports of a registration: measures for --report, warnings for people.
#pragma once

#include "pipeline/registration/pose_choice.h"
#include "pipeline/registration/warp_fit.h"

namespace sonocase::pipeline {

StageReport align_report(const FitContext& s,
                         const PoseChoice& choice,
                         const FitMeasure& fit,
                         double seconds);
StageReport warp_report(const FitContext& s,
                        const WarpFit& warp,
                        const RegisterOptions& options,
                        double seconds);

}  // namespace sonocase::pipeline
