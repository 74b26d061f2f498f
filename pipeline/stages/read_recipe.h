// SPDX-License-Identifier: Apache-2.0

// Reading a recipe: scenarios/<name>/case.toml.
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
//     [resample]                       # options of a stage; `sonocase build --list-options`
//     voxel_mm = 1
//
// [analytic] in place of [inputs] takes the embedded analytic torso, which needs no file. Stages
// may have sections of their own, such as [[region]] and [[pathology]]
// (StageDescriptor::read_sections). Recipe options override those of the preset, and --set
// overrides both. A key that is not known is an error that names file, line, key and the nearest
// valid key.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline stages {

struct RecipeOverrides {
    std::string data;               // --data
    std::string preset;             // --preset; empty: the recipe's own
    std::vector<std::string> sets;  // --set section.key=value
    // --surface: another mannequin than inputs.surface, relative to the working folder; empty:
    // none.
    std::string surface;
};

// path   the recipe, or its folder
// table  the stages whose options the recipe may set; must outlive the recipe
Result<Recipe> load_recipe(const std::string& path,
                           const RecipeOverrides& overrides = {},
                           const StageTable& table = built_in_stages());

// Reads the recipe in the given text. exercises: in place of files beside it; null: those files.
Result<Recipe> parse_recipe(std::string_view text,
                            const std::string& path,
                            const RecipeOverrides& overrides,
                            const std::vector<EmbeddedExercise>* exercises,
                            const StageTable& table = built_in_stages());

// Reads the demonstration torso, which is compiled in and needs no file.
Result<Recipe> embedded_recipe(const RecipeOverrides& overrides = {},
                               const StageTable& table = built_in_stages());

// Reads the acoustic figures of a tissue that a table gives, over those that the tissue has. For
// stages that read sections of their own.
void read_figures(const TomlTable& table, Tissue& tissue);

}  // namespace sonocase::pipeline::inline stages
