// SPDX-License-Identifier: Apache-2.0

// Separable smoothing of the values on a box of nodes.
#pragma once

#include <array>
#include <vector>

#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline segmentation_distance {

// One kernel per axis; along an axis with an empty kernel nothing is done.
struct BoxKernels {
    std::array<std::vector<float>, 3> taps;  // an odd number, centred
    std::array<int, 3> stride{1, 1, 1};      // nodes between taps
    int reach(int axis) const;               // from the centre, nodes
    bool empty() const { return taps[0].empty() && taps[1].empty() && taps[2].empty(); }
};

// K = a G - (a - 1) G * G with the Gaussian G of `sigma` taps; normalised, a such that the second
// moment of K is -`moment`. With a moment of zero, planes are preserved and the surface of a sphere
// of radius R moves by O(sigma^4 / R^3), where a Gaussian moves it by O(sigma^2 / R). Empty for
// sigma <= 0.
std::vector<float> smoothing_kernel(double sigma, double moment = 0);

// A Gaussian of `sigma` taps with the value 1 at 1.2 sigma: spreads a single 1 over that distance.
std::vector<float> spreading_kernel(double sigma);

// In place; values beyond the border repeat it. values: # box.count().
void smooth_box(const VoxelBox& box,
                const BoxKernels& kernels,
                std::vector<float>* values,
                std::vector<float>* scratch);

// The values on `part` of values on `box`, which contains it.
void crop(const VoxelBox& box,
          const std::vector<float>& values,
          const VoxelBox& part,
          std::vector<float>* out);

// The same in place. part: within `box`.
void shrink(const VoxelBox& box, const VoxelBox& part, std::vector<float>* values);

}  // namespace sonocase::pipeline::inline segmentation_distance
