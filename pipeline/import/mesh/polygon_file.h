// SPDX-License-Identifier: Apache-2.0

// PLY, STL and legacy VTK files, read here because VTK 9.1 aborts the program on some that are cut
// off, takes texts with letters beyond ASCII for binary files, and loses what headers say of axes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "pipeline/base/source_checks.h"

namespace sonocase::pipeline::inline import_mesh {

inline constexpr const char* kExportMeshAgain =
    "check that the file is complete; export it again";  // advice of every reader of meshes

struct PolygonFile {
    std::vector<Point3> points;
    std::vector<Vector3> normals;  // # points, or empty
    // Corners of all polygons, one polygon after another, as indices into points. Polygon n ends
    // before corners[ends[n]] and has 3 corners or more.
    std::vector<std::uint32_t> corners;
    std::vector<std::uint64_t> ends;
    Axes axes = Axes::unsaid;  // as a comment or the title says
};

// Reads ASCII and both binary forms; unknown properties are skipped.
Result<PolygonFile> read_ply_file(const std::string& path);

// Reads a data set POLYDATA, ASCII or binary, of versions 1 to 5.1: points, polygons and strips;
// what belongs to points and cells is not read.
Result<PolygonFile> read_vtk_file(const std::string& path);
// The file holds polygons: another data set of that ending is a volume.
bool is_vtk_surface(const std::string& path);

struct TriangleFile {
    std::vector<float> corners;  // 9 for each triangle
    Axes axes = Axes::unsaid;    // as the header or the line "solid" says
};

// Binary if the size is 84 bytes and 50 for each triangle that byte 80 announces, or if it is more
// and the file is not a text; otherwise text, of one or several solids, whatever letters are in
// their names.
Result<TriangleFile> read_stl_file(const std::string& path);

}  // namespace sonocase::pipeline::inline import_mesh
