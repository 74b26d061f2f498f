// SPDX-License-Identifier: Apache-2.0

// Separable smoothing of the values on a box of nodes.
#pragma once

#include <array>
#include <vector>

#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline {

// One kernel an axis; an empty one leaves its axis alone.
struct BoxKernels {
    std::array<std::vector<float>, 3> taps;  // odd, about the middle
    std::array<int, 3> stride{1, 1, 1};      // nodes between taps
    int reach(int axis) const;               // nodes
    bool empty() const { return taps[0].empty() && taps[1].empty() && taps[2].empty(); }
};

// K = a G - (a - 1) G * G, sigma in taps, normalised, with second moment -`moment`: with a moment
// of zero planes stay planes and a sphere of radius R moves by O(sigma^4 / R^3) instead of
// O(sigma^2 / R). Empty for sigma <= 0.
std::vector<float> smoothing_kernel(double sigma, double moment = 0);

// A Gaussian whose value at 1.2 sigma is 1: one mark spreads fully over that reach.
std::vector<float> spreading_kernel(double sigma);

// The border is replicated. `other` is work space.
void smooth_box(const VoxelBox& box,
                const BoxKernels& kernels,
                std::vector<float>* values,
                std::vector<float>* other);

// The values of `box` that lie in `part`, which it holds.
void crop(const VoxelBox& box,
          const std::vector<float>& values,
          const VoxelBox& part,
          std::vector<float>* out);

}  // namespace sonocase::pipeline
