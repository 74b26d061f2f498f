// SPDX-License-Identifier: Apache-2.0

// Basic triangle meshes for the models of the 3-D view.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::runtime {

struct Vertex {
    float position[3];
    float normal[3];
    float texture[2];
};

// A ring about z, and a body lofted through rings, closed at the first and the last one.
// exponent: of the super-ellipse; 2 is an ellipse.
struct Ring {
    double z, half_x, half_y;
};
void loft(const std::vector<Ring>& rings,
          double exponent,
          std::vector<Vertex>& vertices,
          std::vector<std::uint32_t>& indices);

// Of radius 1 about the origin.
void sphere(std::vector<Vertex>& vertices, std::vector<std::uint32_t>& indices);

}  // namespace sonocase::runtime
