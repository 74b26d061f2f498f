// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/models/tool_models.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

Model lofted(const std::vector<Ring>& rings, double exponent) {
    Model model;
    loft(rings, exponent, model.vertices, model.indices);
    return model;
}

// Half widths of the probe: of its face, and of the grip above it.
struct ProbeSize {
    double half_mm, grip_mm;
};
ProbeSize probe_size(const Probe& probe) {
    double half = 0.5 * probe.width_mm;
    if (probe.shape == ProbeShape::curvilinear)
        half = probe.radius_mm * std::sin(0.5 * probe.field_of_view_rad);
    half = std::clamp(half, 8.0, 45.0) + 3;
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

}  // namespace sonocase::runtime
