// SPDX-License-Identifier: Apache-2.0

// The two kinds of surface files. Internal to import; only the file itself is checked.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

// PLY, STL, OBJ, VTP; polygons are cut into triangles and coincident vertices merged.
Result<Surface> read_mesh_file(const std::string& path);
// CSV, TXT, XYZ, PTS, ASC.
Result<Surface> read_point_file(const std::string& path, std::vector<std::string>* warnings);

}  // namespace sonocase::pipeline
