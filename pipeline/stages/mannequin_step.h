// SPDX-License-Identifier: Apache-2.0

// The step "mannequin": reads the digitised mannequin of a recipe.
#pragma once

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline stages {

// The result of the step "mannequin".
struct Mannequin {
    Surface surface;     // `mannequin`, mm
    StageReport report;  // of reading the file; warnings and notes alone
};

// Errors: those of import_surface.
Result<Mannequin> read_mannequin(const Recipe& recipe);

// Returns the extent of the box around the surface's points, mm.
Vector3 extent_of(const Surface& surface);

}  // namespace sonocase::pipeline::inline stages
