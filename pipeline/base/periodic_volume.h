// SPDX-License-Identifier: Apache-2.0

// Operations on a cube of values that wraps at its faces, x fastest.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <span>
#include <vector>

namespace sonocase::pipeline::inline base {

// Filters in place with the taps 1 4 6 4 1 over 16 along x, y and z, `gap` voxels apart. volume: #
// edge^3. Cost: three passes.
void lowpass_periodic(std::vector<float>& volume, int edge, int gap);

// Cube of edge 2 * edge, interpolated by the filter above; the coarse voxels are the even ones.
std::vector<float> double_resolution(const std::vector<float>& volume, int edge);

// Gives `values` the distribution of `sorted` (ascending) and keeps their order. Equal values are
// ordered by position, and the result therefore has exactly that distribution. Cost: one sort.
void match_distribution(std::span<float> values, std::span<const float> sorted);

// Sum of the absolute steps from each plane across `axis` (0..2) to the next; the last step is the
// one across the wrap. # edge
template <class T>
std::vector<double> steps_between_planes(std::span<const T> volume, int edge, int axis) {
    const auto n = static_cast<std::size_t>(edge);
    const std::size_t stride = axis == 0 ? 1 : axis == 1 ? n : n * n;
    std::vector<double> step(n, 0);
    for (std::size_t i = 0; i < volume.size(); ++i) {
        const std::size_t p = i / stride % n;
        const std::size_t next = p + 1 < n ? i + stride : i - p * stride;
        step[p] += std::abs(volume[i] - volume[next]);
    }
    return step;
}

}  // namespace sonocase::pipeline::inline base
