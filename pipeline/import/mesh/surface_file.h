// SPDX-License-Identifier: Apache-2.0

// A digitised surface: a mesh (PLY, STL, OBJ, VTP, VTK, GLB) or a cloud of readings (CSV, XYZ, and
// markups of 3D Slicer).
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"
#include "pipeline/base/source_checks.h"

namespace sonocase::pipeline::inline import_mesh {

struct SurfaceFileOptions {
    double scale = 1;   // mm per unit of the file, > 0; 1: or as the file says; GLB: per metre
    bool torso = true;  // false: any object, with no limits on its size or number of points
    Axes axes = Axes::unsaid;  // told by hand; unsaid: as the file says
};

// The surface in its own frame, mm. A file that says LPS, or of which that is told, is turned to
// RAS+ (half a turn about z); one that says nothing is kept. The report says which, as its note
// "axes".
//
// Meshes: polygons are cut into triangles, coincident vertices are merged, triangles are turned so
// that they agree with their neighbours and are counter-clockwise seen from outside, and each
// vertex gets the outward area-weighted normal. Mesh files without faces, and clouds, give points
// only, with normals if the file has them (nx, ny, nz). Clouds: pipeline/base/point_table.h.
// Readings without a position are left out and counted in `report` (stage "surface_file", may be
// null).
//
// A mesh of more than 400,000 triangles becomes one with a vertex per cube of 4 mm, without parts
// of less than 2 % of the largest; the distance of the given vertices from it is reported. A
// torso's cloud of more than 60,000 readings, whatever its file, becomes one point per cube of 5
// mm, without single readings in the air beside a dense surface.
//
// Errors: no such file, a pipe or a device, unreadable or truncated, and for a torso fewer than 30
// points or an extent that no torso has in mm.
Result<Surface> import_surface(const std::string& path,
                               const SurfaceFileOptions& options = {},
                               StageReport* report = nullptr);

inline constexpr int kMinSurfacePoints = 30;

}  // namespace sonocase::pipeline::inline import_mesh
