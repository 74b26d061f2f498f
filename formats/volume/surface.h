// SPDX-License-Identifier: Apache-2.0

// Surfaces as triangle meshes or as clouds of readings. Millimetres; the frame is the holder's.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase {

struct Surface {
    std::vector<Point3> points;
    std::vector<Vector3> normals;  // outward unit normals; empty, or # points
    // Empty for a cloud. Counter-clockwise when seen from outside.
    std::vector<std::array<std::uint32_t, 3>> triangles;
};

// Unit normals from the triangles around each point, weighted by their area; zero where a point has
// no triangle of any area. Replaces the normals that the surface has.
void add_vertex_normals(Surface& surface);

}  // namespace sonocase
