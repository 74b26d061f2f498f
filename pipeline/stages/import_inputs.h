// SPDX-License-Identifier: Apache-2.0

// The label map or the organ meshes that a recipe names, whichever it is.
#pragma once

#include "pipeline/import/label_map.h"
#include "pipeline/import/organs/mesh_labels.h"
#include "pipeline/stage/recipe.h"

namespace sonocase::pipeline {

// options: of meshes, [import] and [body] of the recipe.
Result<ImportedLabels> import_inputs(const Recipe& recipe,
                                     const MeshImportOptions& options,
                                     const Progress& progress);

}  // namespace sonocase::pipeline
