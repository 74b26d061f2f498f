// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/models/tool_models.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase::runtime::inline display_models {

void loft(const std::vector<Ring>& rings,
          double exponent,
          std::vector<Vertex>& vertices,
          std::vector<std::uint32_t>& indices) {
    constexpr int kAround = 32;
    const auto base = static_cast<std::uint32_t>(vertices.size());
    for (std::size_t r = 0; r < rings.size(); ++r) {
        const Ring& before = rings[r > 0 ? r - 1 : r];
        const Ring& after = rings[r + 1 < rings.size() ? r + 1 : r];
        for (int i = 0; i < kAround; ++i) {
            const double a = 2 * kPi * i / kAround, c = std::cos(a), s = std::sin(a);
            const double power = 2 / exponent;
            const double x = std::copysign(std::pow(std::abs(c), power), c);
            const double y = std::copysign(std::pow(std::abs(s), power), s);
            const double widening =
                0.5 * (after.half_x - before.half_x + after.half_y - before.half_y);
            const Vector3 n = normalized(Vector3{c, s * rings[r].half_x / rings[r].half_y,
                                                 -widening / std::max(after.z - before.z, 1e-3)});
            vertices.push_back(
                {{float(x * rings[r].half_x), float(y * rings[r].half_y), float(rings[r].z)},
                 {float(n.x), float(n.y), float(n.z)},
                 {0, 0}});
        }
    }
    const auto at = [&](std::size_t ring, int i) {
        return base + static_cast<std::uint32_t>(ring) * kAround +
               static_cast<std::uint32_t>(i % kAround);
    };
    for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
        for (int i = 0; i < kAround; ++i) {
            for (std::uint32_t v : {at(r, i), at(r, i + 1), at(r + 1, i + 1), at(r, i),
                                    at(r + 1, i + 1), at(r + 1, i)}) {
                indices.push_back(v);
            }
        }
    }
    for (std::size_t r : {std::size_t{0}, rings.size() - 1}) {
        const float up = r == 0 ? -1.0f : 1.0f;
        const auto middle = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back({{0, 0, float(rings[r].z)}, {0, 0, up}, {0, 0}});
        for (int i = 0; i < kAround; ++i) {
            for (std::uint32_t v : {middle, at(r, i), at(r, i + 1)}) indices.push_back(v);
        }
    }
}

void sphere(std::vector<Vertex>& vertices, std::vector<std::uint32_t>& indices) {
    constexpr int kRows = 10, kAround = 20;
    for (int r = 0; r <= kRows; ++r) {
        for (int i = 0; i <= kAround; ++i) {
            const double b = kPi * r / kRows, a = 2 * kPi * i / kAround;
            const float n[3] = {float(std::sin(b) * std::cos(a)), float(std::sin(b) * std::sin(a)),
                                float(std::cos(b))};
            vertices.push_back({{n[0], n[1], n[2]}, {n[0], n[1], n[2]}, {0, 0}});
        }
    }
    for (int r = 0; r < kRows; ++r) {
        for (int i = 0; i < kAround; ++i) {
            const auto p = static_cast<std::uint32_t>(r * (kAround + 1) + i);
            for (std::uint32_t v :
                 {p, p + 1, p + kAround + 2, p, p + kAround + 2, p + kAround + 1}) {
                indices.push_back(v);
            }
        }
    }
}

namespace {

Model lofted(const std::vector<Ring>& rings, double exponent) {
    Model model;
    loft(rings, exponent, model.vertices, model.indices);
    return model;
}

// Half widths of the probe's face and of the grip above it.
struct ProbeSize {
    double half_mm, grip_mm;
};
ProbeSize probe_size(const Probe& probe) {
    const double half = std::clamp(half_face_mm(probe), 8.0, 45.0) + 3;
    return {half, std::clamp(0.55 * half, 9.0, 17.0)};
}

}  // namespace

Model model_of(const Surface& mesh) {
    Model model;
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        const Point3 p = mesh.points[i];
        const Vector3 n = mesh.normals[i];
        model.vertices.push_back(
            {{float(p.x), float(p.y), float(p.z)}, {float(n.x), float(n.y), float(n.z)}, {0, 0}});
    }
    for (const auto& t : mesh.triangles)
        model.indices.insert(model.indices.end(), t.begin(), t.end());
    return model;
}

Model probe_model(const Probe& probe) {
    const auto [half, grip] = probe_size(probe);
    return lofted({{-158, 4, 4},
                   {-132, 5, 5},
                   {-128, grip - 4, 9},
                   {-120, grip, 12},
                   {-70, grip + 1, 13},
                   {-42, 0.5 * (grip + half), 13},
                   {-20, half, 12},
                   {-5, half, 11},
                   {-1, half - 2, 9}},
                  2.8);
}

Model mark_model(const Probe& probe) {
    const auto [half, grip] = probe_size(probe);
    Model mark = lofted({{-46, 1.6, 2.4}, {-44, 2.4, 3.4}, {-30, 2.4, 3.4}, {-28, 1.6, 2.4}}, 2);
    for (Vertex& v : mark.vertices) v.position[0] += static_cast<float>(0.55 * (grip + half) + 1.5);
    return mark;
}

Model plane_model(const Probe& probe, const PlanePicture& picture) {
    constexpr int kSteps = 32;
    Model plane;
    const Renderer::Layout& layout = picture.layout;
    const double mm = layout.mm_per_px > 0 ? layout.mm_per_px : 0.3;
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps - 0.5;
        for (int end = 0; end < 2; ++end) {
            double x = t * probe.width_mm,
                   z = end * (picture.depth_mm > 0 ? picture.depth_mm : probe.depth_mm);
            if (probe.shape != ProbeShape::linear) {
                const double angle = t * probe.field_of_view_rad;
                const double radius = probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
                x = (radius + z) * std::sin(angle);
                z = (radius + z) * std::cos(angle) - radius;
            }
            const double u = (layout.origin_x_px + (picture.flipped ? -x : x) / mm) /
                             std::max(picture.width_px, 1);
            const double v = (layout.origin_y_px + z / mm) / std::max(picture.height_px, 1);
            plane.vertices.push_back({{float(x), 0, float(z)}, {0, 1, 0}, {float(u), float(v)}});
        }
    }
    for (std::uint32_t i = 0; i < kSteps; ++i) {
        for (std::uint32_t v : {2 * i, 2 * i + 1, 2 * i + 3, 2 * i, 2 * i + 3, 2 * i + 2})
            plane.indices.push_back(v);
    }
    return plane;
}

Model needle_model(double length_mm) {
    return lofted({{-length_mm, 1.1, 1.1}, {-4, 1.1, 1.1}, {0, 0.15, 0.15}}, 2);
}

Model hub_model(double length_mm) {
    const double end = -length_mm;
    return lofted({{end - 32, 4, 4}, {end - 30, 5.5, 5.5}, {end - 6, 5, 5}, {end, 2, 2}}, 2);
}

}  // namespace sonocase::runtime::inline display_models
