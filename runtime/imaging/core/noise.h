// SPDX-License-Identifier: Apache-2.0

// Repeatable noise: a hash, a tile of Gaussian values that every row of samples reads from a random
// start, and smooth periodic noise.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/memory.h"

namespace sonocase::runtime {

// A bijective 32-bit mixing function (two multiply-xorshift rounds); every output bit depends on
// every input bit. Constant time.
inline std::uint32_t hash32(std::uint32_t x) {
    x ^= x >> 16;
    x *= 0x21F0AAADu;
    x ^= x >> 15;
    x *= 0x735A2D97u;
    return x ^ x >> 15;
}

// Inverse of the normal distribution function, for a probability in (0, 1); relative error below
// 2e-9.
double inverse_normal(double probability);

// Start of a row's noise inside the tile, for this frame.
inline constexpr std::uint32_t kNoiseTile = 1u << 16;
inline std::uint32_t noise_row_start(std::uint32_t seed, std::uint32_t frame, std::uint32_t row) {
    return hash32(hash32(seed ^ 0x9E3779B9u * frame) + row) & (kNoiseTile - 1);
}

// The upper 2048 of 4096 equally likely values of a normal distribution of deviation 1; the lower
// ones mirror them. Cost: 0.3 ms.
std::vector<double> normal_levels();

// # kNoiseTile + overhang values, Gaussian with the given deviation, rounded; the overhang repeats
// the beginning, so that a row may be read in one piece from any start.
// upper_levels: normal_levels().
std::vector<std::int8_t> make_noise_tile(std::span<const double> upper_levels,
                                         double sigma,
                                         std::uint32_t seed,
                                         int overhang);

// Smooth periodic noise on a cube, the raw material of roughness and fine structure: edge^3 values,
// x fastest, edge a multiple of 16. White noise after two box filters of 2 * reach + 1 voxels along
// each axis, mean 0, deviation 1. Cost: 2 ms for edge 64.
RawVector<float> smooth_periodic_noise(int edge, int reach, std::uint32_t seed);

}  // namespace sonocase::runtime
