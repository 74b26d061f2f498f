// SPDX-License-Identifier: Apache-2.0

// A recipe: what a case is made of and how. scenarios/<name>/case.toml.
//
//     name = "real-torso"
//     preset = "balanced"              # draft | balanced | accurate
//     exercises = ["liver-biopsy"]     # default: every other .toml beside a case.toml
//
//     [inputs]                         # paths: relative to --data, else to the recipe
//     labels = "ct/labels.nii.gz"
//     surface = "mannequin/sweep.csv"
//
//     [labels]                         # label = tissue, where the built-in table is wrong
//     [tissues.liver]                  # changes of a built-in tissue, or new ones
//     [resample]                       # options of a stage; recipe_keys.h lists them all
//     voxel_mm = 1
//
// [analytic] in place of [inputs] takes the embedded analytic torso, which needs no file.
// Order of precedence: preset, recipe, --set. Whatever the recipe does not know is an error that
// names file, line, key and the nearest valid key.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/tissue.h"
#include "pipeline/cook/stage_options.h"

namespace sonocase::pipeline {

struct RecipeInputs {
    bool analytic = false;
    AnalyticInput torso;  // where analytic
    std::string labels;   // as the recipe names them; resolve() finds the file
    std::string label_table;
    std::string surface;
    std::string examples;   // folder of ultrasound patches; empty: synthetic examples
    std::string landmarks;  // CSV of name,ct_x,ct_y,ct_z,x,y,z
    double labels_scale = 1;
    double surface_scale = 1;
    std::optional<Vector3> up;  // the patient's head direction in the surface's frame
};

struct LabelChoice {
    std::string label;
    std::string tissue;
    int line = 0;
};

struct Recipe {
    std::string path;    // "(embedded)" for the built-in one
    std::string folder;  // of the recipe
    std::string data;    // of --data; may be empty
    std::string text;    // as given
    std::string name;
    std::string preset = "balanced";
    RecipeInputs inputs;
    std::vector<LabelChoice> labels;
    std::vector<Tissue>
        tissues;  // built-in ones with the recipe's changes, and its own; [0] outside
    StageOptions options;
    std::vector<EmbeddedExercise> exercises;  // parsed and found good

    // The file that a path of the recipe means: absolute, below --data, or beside the recipe.
    std::string resolve(const std::string& given) const;
};

struct RecipeOverrides {
    std::string data;               // --data
    std::string preset;             // --preset; empty: the recipe's own
    std::vector<std::string> sets;  // --set section.key=value
};

Result<Recipe> load_recipe(const std::string& path, const RecipeOverrides& overrides = {});

// The recipe with the given text; exercises are those given, not files beside it.
Result<Recipe> parse_recipe(std::string_view text,
                            const std::string& path,
                            const RecipeOverrides& overrides,
                            const std::vector<EmbeddedExercise>* exercises);

// The demonstration torso, compiled in: needs no file.
Result<Recipe> embedded_recipe(const RecipeOverrides& overrides = {});

}  // namespace sonocase::pipeline
