// SPDX-License-Identifier: Apache-2.0

// Counter-based random numbers: a value depends on (seed, counter) alone, and work split over
// threads in any way gives the same bytes. Constant time, no state.
//
// Source: the mixing function of SplitMix64 (formats/base/random.h).
#pragma once

#include <cmath>
#include <cstdint>

#include "formats/base/constants.h"
#include "formats/base/random.h"

namespace sonocase::pipeline::inline base {

inline std::uint64_t mix_bits(std::uint64_t x) {
    return mix64(x + kGoldenGamma);
}

// A separate seed for each purpose, such that streams do not share values.
inline std::uint64_t derive_seed(std::uint64_t seed, std::uint64_t purpose) {
    return mix_bits(seed ^ mix_bits(purpose));
}

// Uniform in [0, 1).
inline double uniform_at(std::uint64_t seed, std::uint64_t counter) {
    return static_cast<double>(mix_bits(seed + mix_bits(counter)) >> 11) * 0x1p-53;
}

struct GaussianPair {
    double a = 0, b = 0;
};

// Two independent standard normal values (Box-Muller).
inline GaussianPair gaussian_pair_at(std::uint64_t seed, std::uint64_t counter) {
    const double u = 1 - uniform_at(seed, 2 * counter);  // (0, 1]: the logarithm is finite
    const double angle = 2 * kPi * uniform_at(seed, 2 * counter + 1);
    const double radius = std::sqrt(-2 * std::log(u));
    return {radius * std::cos(angle), radius * std::sin(angle)};
}

}  // namespace sonocase::pipeline::inline base
