// SPDX-License-Identifier: Apache-2.0

// The suites of the tradeoff, one function each: what is measured, against which truth, with which
// knobs. The knobs of stages are in the descriptors of their options (pipeline/stages/option.h).
// Preparing a suite may take seconds (sampling a body); measuring one setting runs the stage alone.
#pragma once

#include <string>
#include <vector>

#include "pipeline/stages/built_in_stages.h"
#include "pipeline/tradeoff/sweep.h"

namespace sonocase::pipeline::inline tradeoff {

// Fit of the demo torso's skin to its mannequin: distance of inner points from where the known warp
// puts them.
Suite register_suite();
// Fit of the demo torso to a mannequin of another build: change of its organs.
Suite elastic_suite();
// Inverse map and resampling of the demo torso through its known warp: displacement of surfaces.
Suite warp_suite();
// Smoothing: the same measure, on slices 6 mm thick, with the paper's eq. (10) as comparison.
Suite smooth_suite();
// Solid textures against their example.
Suite texture_suite();
// Probe point from synthetic recordings with a known tip.
Suite calibrate_suite();
// Point spread and grey of a known machine from frames of its own.
Suite look_suite();
// Frames of the player that lies beside this program, against its finest sampling.
Suite render_suite();
// Frames of that player with and without each effect: what it changes and costs.
Suite effects_suite();
// The same frames with a linear probe, whose pictures have plates and grounds of their own.
Suite linear_suite();
// The press field against the finite element blocks in data/deformation, by the program press_block
// beside this one.
Suite press_suite(const std::string& data);
// Surfaces in a box of the demo torso against the voxels of its region.
Suite region_suite();
// Volumes of ten lesions against voxel size.
Suite pathology_suite();
// Pulses of colour Doppler and points of the spectral gate, on a tube of known flow, by the program
// doppler_trial beside this one.
Suite colour_suite();
Suite spectrum_suite();
// Pixels, corners and tags of a camera that follows printed markers, by the program camera_trial
// beside this one.
Suite camera_suite();
// Points that the level of free fluid is counted by, in ellipsoids cut at known volumes.
Suite fluid_suite();
// The cost that a build predicts against the time it takes, measured by commands.
Suite cost_suite();
// `sonocase make` on a segmentation of the demo torso; and what a page waits for of such a case.
Suite make_suite();
Suite publish_suite();
// The whole chain on the demo torso, or another body of the same family.
Suite case_suite(const AnalyticBody& body, const std::string& body_name);
// The whole chain on a user's case, against its own finest setting.
Suite own_case_suite(const Recipe& recipe);

// Sets the options of the stages by the names that a recipe uses for them. Error: an
// option or a value that the stages do not know.
Status apply_settings(const Settings& settings, StageSettings& options);

// The presets of the table as settings.
std::vector<NamedSettings> preset_points(const StageTable& table);

// The knobs of one suite: every option of the table that is swept in it, with its default.
std::vector<Knob> knobs_of(const StageTable& table, const std::string& suite);

}  // namespace sonocase::pipeline::inline tradeoff
