// SPDX-License-Identifier: Apache-2.0

// The suites of the tradeoff, one function each: what is measured, against which truth, by which
// knobs. Preparing a suite may take seconds (sampling a body); measuring one setting runs the stage
// alone.
#pragma once

#include <string>
#include <vector>

#include "pipeline/cook/recipe.h"
#include "pipeline/tradeoff/trial.h"

namespace sonocase::pipeline {

// Fit of the demo torso's skin to its mannequin: distance of inner points from where the known warp
// puts them.
Suite register_suite();
// Inverse map and resampling of the demo torso through its known warp: displacement of surfaces.
Suite warp_suite();
// Smoothing: the same measure, on slices 6 mm thick, with the paper's eq. (10) as comparison.
Suite smooth_suite();
// Solid textures against their example.
Suite texture_suite();
// Probe point from synthetic recordings with a known tip.
Suite calibrate_suite();
// Frames of the player beside this program, against its finest sampling.
Suite render_suite();
// The whole chain on the demo torso, or another body of the same family.
Suite case_suite(const AnalyticBody& body, const std::string& body_name);
// The whole chain on a user's case, against its own finest setting.
Suite own_case_suite(const Recipe& recipe);

// Settings put into the options of the stages by the recipe's own table of keys.
Status apply_settings(const Settings& settings, StageOptions& options);

}  // namespace sonocase::pipeline
