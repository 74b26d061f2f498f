// SPDX-License-Identifier: Apache-2.0

// From a rigid pose to the complete map: RANSAC, the point-to-surface quadratic with as much
// freedom as the data justify, the residual field, and the checks between them.
#pragma once

#include <string>
#include <vector>

#include "pipeline/registration/fit_context.h"
#include "pipeline/registration/map/one_to_one_proof.h"

namespace sonocase::pipeline {

struct WarpFit {
    Registration registration;
    RansacResult ransac;
    double constraint_mm = 0;  // the chosen weight; 0: none, the map is that of RANSAC or rigid
    double condition = 0;
    QuadraticTrust trust, rigid_trust;
    bool kept_rigid = false;  // the quadratic did not explain left-out patches better
    double least_det = 1, sampled_det = 1;
    ResidualReport residual;
    std::string path = "quadratic", reason;  // "quadratic", "residual" or "elastic", and why
    ElasticFit elastic;
    int elastic_refits = 0;  // stiffer ones, after the first
    double stiffness = 0;    // of the elastic warp; 0: it was not tried
    OneToOneProof one_to_one;
    std::vector<OrganChange> organs;  // empty without labels
    FitMeasure rigid_fit, quadratic_fit, fit;
    double residual_mean_mm = 0;  // at the skin
    std::vector<std::string> warnings;
};

WarpFit fit_warp(const FitContext& s,
                 const Rigid& rigid,
                 const RegisterOptions& options,
                 const Progress& progress);

}  // namespace sonocase::pipeline
