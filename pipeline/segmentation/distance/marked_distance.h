// SPDX-License-Identifier: Apache-2.0

// Distance to the nearest of some marked voxels, at any range.
//
// Exact Euclidean distance between voxel centres by lower envelopes of parabolas, one axis after
// the other: Felzenszwalb and Huttenlocher, Theory of Computing 8:415 (2012). Unlike
// signed_distance its cost does not grow with the range. Cost: 60 ns per voxel and thread, 8 bytes
// per voxel.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline::inline segmentation_distance {

inline constexpr float kNoMark = 1e9f;  // distance where nothing is marked

// marked: # product of size, x fastest; not 0: marked. Result in voxels, 0 at marked ones. Same
// values for any number of threads.
std::vector<float> distance_to_marked(const std::vector<std::uint8_t>& marked, Int3 size);

}  // namespace sonocase::pipeline::inline segmentation_distance
