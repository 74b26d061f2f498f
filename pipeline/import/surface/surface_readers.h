// SPDX-License-Identifier: Apache-2.0

// The two kinds of surface files. Internal to import; only the file itself is checked.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

// PLY, STL, OBJ, VTP; polygons are cut into triangles and coincident vertices merged. A mesh of
// more than kDenseTriangles is reduced (dense_mesh.h), and the report says so. scale: mm per unit
// of the file; the surface stays in that unit.
Result<Surface> read_mesh_file(const std::string& path, double scale, StageReport* report);
// CSV, TXT, XYZ, PTS, ASC.
Result<Surface> read_point_file(const std::string& path, std::vector<std::string>* warnings);

}  // namespace sonocase::pipeline
