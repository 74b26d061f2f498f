// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/surface.h"

namespace sonocase {

void add_vertex_normals(Surface& surface) {
    surface.normals.assign(surface.points.size(), Vector3{});
    for (const auto& t : surface.triangles) {
        const Point3 a = surface.points[t[0]], b = surface.points[t[1]], c = surface.points[t[2]];
        const Vector3 twice_area = cross(b - a, c - a);
        for (const std::uint32_t v : t) surface.normals[v] = surface.normals[v] + twice_area;
    }
    for (Vector3& normal : surface.normals) normal = normalized(normal);
}

}  // namespace sonocase
