// SPDX-License-Identifier: Apache-2.0

// Leaves whose scan a case was made from out of its manifest: paths, names of files and folders and
// comments of a recipe often hold a patient's name.
#pragma once

#include <string>

#include "formats/bundle/case_bundle.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline cook {

// "labels.nii.gz", "scan", "surface.csv": what a file of [inputs] is for, and its ending where that
// is a usual one. Any other path comes back as its last part.
std::string role_of_input(const Recipe& recipe, const std::string& given);

// The recipe's text without comments, and with each path of [inputs] by its role. It parses to the
// same recipe but for those paths.
std::string recipe_without_names(const Recipe& recipe);

// Recipe and inputs of the manifest as above. In what stages report, paths and names of the input
// files become their roles; call it when all stages are in.
void leave_out_names(const Recipe& recipe, CaseManifest& manifest);

}  // namespace sonocase::pipeline::inline cook
