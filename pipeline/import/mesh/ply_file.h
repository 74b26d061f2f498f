// SPDX-License-Identifier: Apache-2.0

// PLY, read here because VTK 9.1 aborts the program on a truncated file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::pipeline::inline import_mesh {

struct PolygonFile {
    std::vector<Point3> points;
    std::vector<Vector3> normals;  // # points, or empty
    // Corners of all polygons, one polygon after another, as indices into points. Polygon n ends
    // before corners[ends[n]] and has 3 corners or more.
    std::vector<std::uint32_t> corners;
    std::vector<std::uint64_t> ends;
};

// Reads ASCII and both binary forms; unknown properties are skipped.
Result<PolygonFile> read_ply_file(const std::string& path);

}  // namespace sonocase::pipeline::inline import_mesh
