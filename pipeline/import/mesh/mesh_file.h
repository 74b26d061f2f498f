// SPDX-License-Identifier: Apache-2.0

// Reads mesh files, for import_surface: checks the file itself and not what it shows.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"
#include "pipeline/base/source_checks.h"

namespace sonocase::pipeline::inline import_mesh {

struct MeshFile {
    Surface surface;           // in the file's unit and axes; GLB: in metres, RAS+ or as told
    Axes axes = Axes::unsaid;  // as the file says
    double unit_mm = 1;
};

bool is_mesh_file(const std::string& path);  // by its ending; a .vtk by its data set as well

// Reads PLY, STL, OBJ, VTP, legacy VTK or GLB; polygons are cut into triangles and coincident
// vertices merged. A mesh of more than 400,000 triangles is reduced, and the report says so. scale:
// mm per unit of the file (GLB: metres). told: axes told by hand, for GLB alone.
Result<MeshFile> read_mesh_file(const std::string& path,
                                double scale,
                                Axes told,
                                StageReport* report);

}  // namespace sonocase::pipeline::inline import_mesh
