// SPDX-License-Identifier: Apache-2.0

// Reads the two kinds of surface files, for import_surface: they check the file itself and not what
// it shows.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline::inline import_mesh {

// Reads PLY, STL, OBJ or VTP; polygons are cut into triangles and coincident vertices merged. A
// mesh of more than 400,000 triangles is reduced, and the report says so. scale: mm per unit of the
// file; the surface stays in that unit.
Result<Surface> read_mesh_file(const std::string& path, double scale, StageReport* report);
// Reads CSV, TXT, XYZ, PTS or ASC.
Result<Surface> read_point_file(const std::string& path, std::vector<std::string>* warnings);

}  // namespace sonocase::pipeline::inline import_mesh
