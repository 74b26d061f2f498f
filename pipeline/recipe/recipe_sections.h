// SPDX-License-Identifier: Apache-2.0

// The sections of a recipe that say what a case is made of. Faults are kept in the document that
// the tables belong to (formats/text/toml_reader.h).
#pragma once

#include <optional>
#include <vector>

#include "formats/text/toml_reader.h"
#include "pipeline/pathology/pathology.h"
#include "pipeline/segmentation/region_request.h"
#include "pipeline/stage/recipe.h"

namespace sonocase::pipeline {

void read_inputs(const TomlTable& table, RecipeInputs& inputs);              // [inputs]
void read_analytic(const TomlTable& table, RecipeInputs& inputs);            // [analytic]
void read_labels(const TomlTable& table, std::vector<LabelChoice>& labels);  // [labels]
// [tissues]: changes those in the list, and adds new ones to it.
void read_tissues(const TomlTable& table, std::vector<Tissue>& tissues);
// The figures of a tissue that the table gives, over those that it has.
void read_figures(const TomlTable& table, Tissue& tissue);
// [[pathology]]: adds the tissues of its kinds, and those that it changes, to the list.
void read_pathology(const TomlTable& root,
                    std::vector<PathologyRequest>& pathology,
                    std::vector<Tissue>& tissues);

// [[region]]; one at most.
void read_region(const TomlTable& root, std::optional<RegionRequest>& region);

}  // namespace sonocase::pipeline
