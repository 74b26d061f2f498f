// SPDX-License-Identifier: Apache-2.0

// Meshes with known volumes, and GLB files made of them.
#pragma once

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/volume/surface.h"

namespace sonocase::testing {

// A ball of latitude rings; inwards: turned inside out.
inline Surface ball_mesh(Point3 centre, double radius_mm, int rings = 24, bool inwards = false) {
    Surface s;
    const int around = 2 * rings;
    s.points.push_back(centre + Vector3{0, 0, radius_mm});
    for (int r = 1; r < rings; ++r)
        for (int a = 0; a < around; ++a) {
            const double t = kPi * r / rings, p = 2 * kPi * a / around;
            s.points.push_back(centre + radius_mm * Vector3{std::sin(t) * std::cos(p),
                                                            std::sin(t) * std::sin(p),
                                                            std::cos(t)});
        }
    s.points.push_back(centre - Vector3{0, 0, radius_mm});
    const auto at = [&](int r, int a) {
        return static_cast<std::uint32_t>(1 + (r - 1) * around + a % around);
    };
    const auto last = static_cast<std::uint32_t>(s.points.size() - 1);
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        if (inwards)
            s.triangles.push_back({a, c, b});
        else
            s.triangles.push_back({a, b, c});
    };
    for (int a = 0; a < around; ++a) {
        add(0, at(1, a), at(1, a + 1));
        add(last, at(rings - 1, a + 1), at(rings - 1, a));
        for (int r = 1; r + 1 < rings; ++r) {
            add(at(r, a), at(r + 1, a), at(r + 1, a + 1));
            add(at(r, a), at(r + 1, a + 1), at(r, a + 1));
        }
    }
    return s;
}

// The same without the triangles that lie above a height: an open bowl.
inline Surface without_top(const Surface& whole, double above_z) {
    Surface s;
    s.points = whole.points;
    for (const auto& t : whole.triangles)
        if (whole.points[t[0]].z <= above_z || whole.points[t[1]].z <= above_z ||
            whole.points[t[2]].z <= above_z)
            s.triangles.push_back(t);
    return s;
}

struct GlbNode {
    std::string name;
    Surface surface;
    std::string more;  // members of the node: "\"translation\":[1,0,0]"
    std::string mesh_name = {};
    int mode = 4;  // of the primitive
};

inline std::vector<std::uint8_t> glb_of(const std::vector<GlbNode>& nodes,
                                        const std::string& more = "") {
    std::vector<std::uint8_t> bin;
    const auto put = [&](const void* from, std::size_t n) {
        const auto* b = static_cast<const std::uint8_t*>(from);
        bin.insert(bin.end(), b, b + n);
    };
    std::string node_list, meshes, views, accessors;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const Surface& s = nodes[n].surface;
        const std::size_t points_at = bin.size();
        for (const Point3 p : s.points)
            for (int axis = 0; axis < 3; ++axis) {
                const auto x = static_cast<float>(p[axis]);
                put(&x, 4);
            }
        const std::size_t corners_at = bin.size();
        for (const auto& t : s.triangles)
            for (const std::uint32_t corner : t) put(&corner, 4);
        const std::string comma = n > 0 ? "," : "";
        const auto num = [](std::size_t v) { return std::to_string(v); };
        node_list += comma + "{\"name\":\"" + nodes[n].name + "\",\"mesh\":" + num(n) +
                     (nodes[n].more.empty() ? "" : "," + nodes[n].more) + "}";
        meshes += comma + "{\"name\":\"" + nodes[n].mesh_name +
                  "\",\"primitives\":[{\"mode\":" + std::to_string(nodes[n].mode) +
                  ",\"attributes\":{\"POSITION\":" + num(2 * n) +
                  "},\"indices\":" + num(2 * n + 1) + "}]}";
        views += comma + "{\"buffer\":0,\"byteOffset\":" + num(points_at) +
                 ",\"byteLength\":" + num(corners_at - points_at) +
                 "},{\"buffer\":0,\"byteOffset\":" + num(corners_at) +
                 ",\"byteLength\":" + num(bin.size() - corners_at) + "}";
        accessors +=
            comma + "{\"bufferView\":" + num(2 * n) +
            ",\"componentType\":5126,\"type\":\"VEC3\",\"count\":" + num(s.points.size()) +
            "},{\"bufferView\":" + num(2 * n + 1) +
            ",\"componentType\":5125,\"type\":\"SCALAR\",\"count\":" + num(3 * s.triangles.size()) +
            "}";
    }
    std::string json = "{\"asset\":{\"version\":\"2.0\"}" + (more.empty() ? "" : "," + more) +
                       ",\"nodes\":[" + node_list + "],\"meshes\":[" + meshes +
                       "],\"bufferViews\":[" + views + "],\"accessors\":[" + accessors +
                       "],\"buffers\":[{\"byteLength\":" + std::to_string(bin.size()) + "}]}";
    while (json.size() % 4 != 0) json += ' ';
    std::vector<std::uint8_t> out;
    const auto word = [&](std::uint32_t w) {
        const auto* b = reinterpret_cast<const std::uint8_t*>(&w);
        out.insert(out.end(), b, b + 4);
    };
    word(0x46546C67);
    word(2);
    word(static_cast<std::uint32_t>(28 + json.size() + bin.size()));
    word(static_cast<std::uint32_t>(json.size()));
    word(0x4E4F534A);
    out.insert(out.end(), json.begin(), json.end());
    word(static_cast<std::uint32_t>(bin.size()));
    word(0x004E4942);
    out.insert(out.end(), bin.begin(), bin.end());
    return out;
}

}  // namespace sonocase::testing
