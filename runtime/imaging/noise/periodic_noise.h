// SPDX-License-Identifier: Apache-2.0

// Smooth periodic noise of unit deviation on a cube: the raw material of roughness and fine
// structure.
#pragma once

#include <cstdint>

#include "formats/base/raw_vector.h"

namespace sonocase::runtime {

// edge^3 values, x fastest, edge a multiple of 16: white noise after two box filters of
// 2 * reach + 1 voxels along each axis, mean 0, deviation 1. Cost: 2 ms for edge 64.
RawVector<float> smooth_periodic_noise(int edge, int reach, std::uint32_t seed);

}  // namespace sonocase::runtime
