// SPDX-License-Identifier: Apache-2.0

// What a case is made of and how: the contents of a recipe, scenarios/<name>/case.toml.
//
// pipeline/recipe reads one from a file; a stage's verb fills one in from its flags.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/tissue.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/stage/stage_settings.h"

namespace sonocase::pipeline {

// Millimetres per unit of an input file: what a recipe and --scale may say.
inline constexpr double kSmallestScale = 1e-6, kLargestScale = 1e6;

// The embedded torso as an input: sampling of its "CT" and readings of its mannequin.
struct AnalyticInput {
    AnalyticBody body;
    AnalyticMannequinOptions mannequin;
    double voxel_mm = 2;
    double slice_mm = 3;
    int landmarks = 0;             // marked on both bodies, see analytic_torso_landmarks
    double landmark_noise_mm = 1;  // of each landmark and axis, standard deviation
    bool known_map = false;        // take the map that made the mannequin instead of fitting one
};

struct RecipeInputs {
    bool analytic = false;
    AnalyticInput torso;  // where analytic
    std::string labels;   // as the recipe names them; Recipe::resolve finds the file
    std::string label_table;
    std::string surface;
    std::string examples;   // folder of ultrasound patches; empty: synthetic examples
    std::string landmarks;  // CSV of name,ct_x,ct_y,ct_z,x,y,z
    double labels_scale = 1;
    double surface_scale = 1;
    std::optional<Vector3> up;  // the patient's head direction in the surface's frame
};

// A line of [labels]: the tissue that a label is made of.
struct LabelChoice {
    std::string label;
    std::string tissue;
    int line = 0;
};

struct Recipe {
    std::string path;    // "(embedded)/case.toml" for the built-in one
    std::string folder;  // of the recipe
    std::string data;    // of --data; may be empty
    std::string text;    // as given
    std::string name;
    std::string preset = "balanced";
    RecipeInputs inputs;
    std::vector<LabelChoice> labels;
    std::vector<Tissue> tissues;  // the built-in ones with the recipe's changes, then its own ones;
                                  // [0] is the outside
    StageSettings settings;
    std::vector<EmbeddedExercise> exercises;  // parsed and found valid

    // The file that a path of the recipe means: absolute, below --data, or beside the recipe.
    std::string resolve(const std::string& given) const;
};

// Content hashes of the files that a recipe names; empty where it names none.
struct InputDigests {
    std::string labels, label_table, surface, examples, landmarks;
    std::vector<InputHash> files;  // those named, in this order
};

}  // namespace sonocase::pipeline
