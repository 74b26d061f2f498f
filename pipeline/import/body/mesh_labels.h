// SPDX-License-Identifier: Apache-2.0

// Organ meshes as a label volume in `ct`; what they lack is filled in by rule.
#pragma once

#include <string>

#include "pipeline/import/body/body_rules.h"
#include "pipeline/import/mesh/mesh_folder.h"
#include "pipeline/import/volume/label_map.h"

namespace sonocase::pipeline::inline import_body {

struct MeshImportOptions {
    MeshOptions mesh;
    BodyOptions body;
    std::string anatomy = "check";  // of label maps as well: refuse what is no body, or "accept"
};

inline constexpr int kMeshImportVersion = 3;

// path: a folder of GLB, STL, PLY, OBJ and VTP files, or one of them; table: node_table.h. Where
// solids overlap the smaller one remains; then the rules of [body] take what only the skin
// encloses. The report says how much of the body came from meshes, and keeps the attribution.
Result<ImportedLabels> import_meshes(const std::string& path,
                                     const std::string& table,
                                     const MeshImportOptions& options = {},
                                     const Progress& progress = {});

}  // namespace sonocase::pipeline::inline import_body
