// SPDX-License-Identifier: Apache-2.0

// Triangle models of probe, scan plane and needle for the 3-D view, each in its tool's frame, mm,
// and the basic meshes that they are made of.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"
#include "formats/volume/surface.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline display_models {

struct Vertex {
    float position[3];
    float normal[3];
    float texture[2];
};

// A ring about z.
struct Ring {
    double z, half_x, half_y;
};
// A body lofted through rings, closed at the first and the last one.
// exponent: exponent of the super-ellipse; 2 is an ellipse.
void loft(const std::vector<Ring>& rings,
          double exponent,
          std::vector<Vertex>& vertices,
          std::vector<std::uint32_t>& indices);

// A sphere of radius 1 about the origin.
void sphere(std::vector<Vertex>& vertices, std::vector<std::uint32_t>& indices);

struct Model {
    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;  // three per triangle
};

// Makes a model of a mesh of skin_mesh.h, without a texture.
Model model_of(const Surface& mesh);

Model probe_model(const Probe& probe);
// The orientation mark on the side of the probe.
Model mark_model(const Probe& probe);

// How the picture is placed on the scan plane.
struct PlanePicture {
    Renderer::Layout layout;
    double depth_mm = 0;  // 0: the depth of the probe
    bool flipped = false;
    int width_px = 0, height_px = 0;
};
// The scan plane, with texture coordinates of the picture.
Model plane_model(const Probe& probe, const PlanePicture& picture);

// Thicker than a real needle, which would vanish at the size of the view.
Model needle_model(double length_mm);
Model hub_model(double length_mm);

}  // namespace sonocase::runtime::inline display_models
