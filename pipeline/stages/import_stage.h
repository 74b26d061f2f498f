// SPDX-License-Identifier: Apache-2.0

// Reads the label map or the organ meshes that a recipe names.
#pragma once

#include "pipeline/import/body/mesh_labels.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline stages {

// options  how meshes are read: [import] and [body] of the recipe
Result<ImportedLabels> import_inputs(const Recipe& recipe,
                                     const MeshImportOptions& options,
                                     const Progress& progress);

// Measures the label map that organ meshes become. Errors: those of reading the meshes.
Result<MeshExtent> mesh_inputs_extent(const Recipe& recipe);

}  // namespace sonocase::pipeline::inline stages
