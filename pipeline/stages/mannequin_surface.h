// SPDX-License-Identifier: Apache-2.0

// The digitised mannequin of a recipe.
#pragma once

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"
#include "pipeline/stage/recipe.h"

namespace sonocase::pipeline {

// The result of the step "mannequin".
struct Mannequin {
    Surface surface;     // `mannequin`, mm
    StageReport report;  // of reading the file; warnings alone
};

// Errors: those of import_surface.
Result<Mannequin> read_mannequin(const Recipe& recipe);

// Of the box around its points, mm.
Vector3 extent_of(const Surface& surface);

}  // namespace sonocase::pipeline
