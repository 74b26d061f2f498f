// SPDX-License-Identifier: Apache-2.0

// Which of the rigid candidates is the patient's pose, and which others fit nearly as well.
#pragma once

#include <string>
#include <vector>

#include "pipeline/registration/fit_context.h"

namespace sonocase::pipeline::inline registration {

// A candidate after a stiff quadratic and a coarse field.
struct JudgedPose {
    RigidCandidate rigid;
    RigidQuadratic quadratic;
    // Root of the total cost: gaps, missing counterparts, deformation and hints.
    double score_mm = 0;
    double skin_coverage = 0;  // share of the skin that has a counterpart
    double coverage = 0;
    double back_cost_mm2 = 0;  // the part of score_mm^2 for the open side of the sweep
};

struct PoseChoice {
    JudgedPose best;
    std::vector<RunnerUp> runners_up;  // best first
    bool open_side_dropped = false;    // the sweep is of a flank: the open side was not considered
    double mirror_score_mm = 0;        // of the mirrored surface
    double turned_score_mm = 0;        // of the best pose with the head away from `up`; 0: no `up`
    double front_turned_score_mm = 0;  // of the pose turned front to back
    std::string front;                 // whether the skin tells front from back
    std::string head;  // whether the skin tells the given `up` from its opposite; empty: no `up`
    std::string handedness;  // whether the skin tells right-handed axes from left-handed
    std::vector<std::string> warnings;
};

PoseChoice choose_pose(const FitContext& s,
                       const RegisterOptions& options,
                       const Progress& progress);

}  // namespace sonocase::pipeline::inline registration
