// SPDX-License-Identifier: Apache-2.0

// Triangle models of probe, scan plane and needle for the 3-D view, each in its tool's frame, mm.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/volume/surface.h"
#include "runtime/display/models/shapes.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

struct Model {
    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;  // three per triangle
};

// A mesh of skin_mesh.h, without a texture.
Model model_of(const Surface& mesh);

Model probe_model(const Probe& probe);
// The orientation mark on the side of the probe.
Model mark_model(const Probe& probe);

// How the picture is placed on the scan plane.
struct PlanePicture {
    Renderer::Layout layout;
    double depth_mm = 0;  // 0: the probe's
    bool flipped = false;
    int width_px = 0, height_px = 0;
};
// The scan plane, with texture coordinates of the picture.
Model plane_model(const Probe& probe, const PlanePicture& picture);

// Thicker than life, because it would vanish at the size of the view.
Model needle_model(double length_mm);
Model hub_model(double length_mm);

}  // namespace sonocase::runtime
