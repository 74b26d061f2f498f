// SPDX-License-Identifier: Apache-2.0

// Operations on a cube of values that wraps at its faces, x fastest.
#pragma once

#include <span>
#include <vector>

namespace sonocase::pipeline {

// In place, taps 1 4 6 4 1 over 16 along x, y and z, `gap` voxels apart. Cost: three passes.
void lowpass_periodic(std::vector<float>& volume, int edge, int gap);

// Cube of 2 * edge, interpolated with the filter above: each coarse voxel sits at the even ones.
std::vector<float> double_resolution(const std::vector<float>& volume, int edge);

// Gives `values` the distribution of `sorted` (rising) and keeps their order. Equal values are told
// apart by their place, so the answer has exactly the wanted distribution. Cost: one sort.
void match_distribution(std::span<float> values, std::span<const float> sorted);

}  // namespace sonocase::pipeline
