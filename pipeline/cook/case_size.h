// SPDX-License-Identifier: Apache-2.0

// How large a case is, before anything of it is cooked: what the cost of its stages goes by.
#pragma once

#include "formats/base/result.h"
#include "pipeline/stage/recipe.h"
#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

// From headers and the mannequin's extent; what cannot be read counts as nothing. A region round a
// label needs the label map itself, which costs as much as its import.
CaseSize case_size(const Recipe& recipe);

// Volume of the grid that cooking would fill, from the mannequin's extent alone. Errors: those of
// reading the mannequin.
Result<double> cooked_volume_mm3(const Recipe& recipe);

}  // namespace sonocase::pipeline
