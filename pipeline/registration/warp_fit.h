// SPDX-License-Identifier: Apache-2.0

// From a rigid pose to the whole map: RANSAC, the quadratic from points to surfaces with the
// freedom that the data deserve, the residual field, and the guards between them.
#pragma once

#include <string>
#include <vector>

#include "pipeline/registration/fit_context.h"

namespace sonocase::pipeline {

struct WarpFit {
    Registration registration;
    RansacResult ransac;
    double constraint_mm = 0;  // of the weight taken; 0: none, the map is RANSAC's or rigid
    double condition = 0;
    QuadraticTrust trust, rigid_trust;
    bool kept_rigid = false;  // the quadratic explained left-out patches no better
    double least_det = 1, sampled_det = 1;
    ResidualReport residual;
    FitMeasure rigid_fit, quadratic_fit, fit;
    double residual_mean_mm = 0;  // at the skin
    std::vector<std::string> warnings;
};

WarpFit fit_warp(const FitContext& s,
                 const Rigid& rigid,
                 const RegisterOptions& options,
                 const Progress& progress);

}  // namespace sonocase::pipeline
