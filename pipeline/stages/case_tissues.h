// SPDX-License-Identifier: Apache-2.0

// Which tissue each label of a case is made of: the built-in choice with the recipe's [labels] laid
// over it.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"
#include "pipeline/stage/recipe.h"

namespace sonocase::pipeline {

// The result of the step "tissues".
struct CaseTissues {
    std::vector<Label> palette;   // of the cooked labels, with the tissues of the recipe
    std::vector<Tissue> tissues;  // those that the palette names, in the recipe's order; outside
                                  // first
};

// Errors name the line of the recipe: a tissue or a label that does not exist. A class of
// TotalSegmentator that the labels lack is not an error: a recipe may serve many patients.
Status assign_tissues(const Recipe& recipe, std::vector<Label>& labels);

// Everything of them that textures and structure can depend on.
std::string tissues_text(const std::vector<Tissue>& tissues);

}  // namespace sonocase::pipeline
