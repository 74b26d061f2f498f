// SPDX-License-Identifier: Apache-2.0

// The two kinds of surface files. Internal to import; no checks but of the file itself.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

// PLY, STL, OBJ, VTP; polygons are triangles, vertices that coincide are one.
Result<Surface> read_mesh_file(const std::string& path);
// CSV, TXT, XYZ, PTS, ASC.
Result<Surface> read_point_file(const std::string& path, std::vector<std::string>* warnings);

}  // namespace sonocase::pipeline
