// SPDX-License-Identifier: Apache-2.0

// From a rigid pose to the complete map: the point-to-surface quadratic with as much freedom as the
// data justify, then the displacement that follows it. Nothing is drawn at random; only the paper's
// own warp has its random consensus.
//
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
#include "pipeline/registration/fit_context.h"
#include "pipeline/registration/map/map_proofs.h"

namespace sonocase::pipeline::inline registration {

struct WarpFit {
    Registration registration;
    RansacResult ransac;       // of the paper's warp
    double constraint_mm = 0;  // the chosen weight; 0: none, the map is that of RANSAC or rigid
    double condition = 0;
    QuadraticTrust trust, rigid_trust;
    bool kept_rigid = false;  // the quadratic did not explain left-out patches better
    double min_det = 1, sampled_det = 1;
    ResidualReport residual;
    std::string path = "quadratic", reason;  // "quadratic", "residual" or "elastic", and why
    ElasticFit elastic;
    int elastic_refits = 0;  // stiffer ones, after the first
    double stiffness = 0;    // of the elastic warp; 0: it was not tried
    OneToOneProof one_to_one;
    std::vector<OrganChange> organs;  // empty without labels
    std::vector<OrganUnknown> unknown;
    double inside_mm = 0;          // expected error inside the body, whatever the true map; rms
    double with_landmarks_mm = 0;  // the same if two landmarks were given; 0: some are
    FitMeasure rigid_fit, quadratic_fit, fit;
    double residual_mean_mm = 0;       // at the skin
    std::vector<RefineOptions> steps;  // of the quadratic, to the map that was chosen
    std::vector<std::string> warnings;
};

WarpFit fit_warp(const FitContext& s,
                 const Rigid& rigid,
                 const RegisterOptions& options,
                 const Progress& progress);

// What the residual warp has to reach to be kept.
inline constexpr double kSufficientP95Mm = 3, kSufficientVolume = 0.08, kMinOrganMl = 20;
// What a structure may change by before a warning says so.
inline constexpr double kVolumeTolerance = 0.1, kShapeTolerance = 0.2;

// Chooses the displacement of w, which holds the residual warp if that was fitted. Sets its path,
// reason, one-to-one bounds, organs and warnings, and replaces its map if the elastic warp is
// taken.
void choose_warp(const FitContext& s,
                 const RegisterOptions& options,
                 const Progress& progress,
                 WarpFit* w);

}  // namespace sonocase::pipeline::inline registration
