// SPDX-License-Identifier: Apache-2.0

// Triangle meshes of probe, needle and targets for the 3-D view.
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

// A body lofted through rounded rings about z: (z, half width x, half width y), first and last
// closed. exponent: of the super-ellipse, 2 is round.
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
