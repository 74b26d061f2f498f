// SPDX-License-Identifier: Apache-2.0

// The step "tissues": which tissue each label of a case is made of, by the built-in choice and the
// recipe's [labels] over it. Textures and structure take the tissues and not the labels, so that
// textures stay in the cache when only voxels change.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline stages {

// The result of the step "tissues".
struct CaseTissues {
    std::vector<Label> palette;  // of the cooked labels, with the tissues of the recipe
    // Those that the palette names, in the recipe's order; outside first.
    std::vector<Tissue> tissues;
};

// Errors name the line of the recipe: a tissue or a label that does not exist. A class of
// TotalSegmentator that the labels lack is not an error: a recipe may serve many patients.
Status assign_tissues(const Recipe& recipe, std::vector<Label>& labels);

// Returns everything of the tissues that textures and structure can depend on, as text.
std::string tissues_text(const std::vector<Tissue>& tissues);

}  // namespace sonocase::pipeline::inline stages
