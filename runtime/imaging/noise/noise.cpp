// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/noise/noise.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {

double inverse_normal(double p) {
    // Start from a logistic fit and polish with Newton steps on the normal distribution function.
    double x = 5.5556 * (1 - std::pow((1 - p) / p, 0.1186));
    if (!(x > -8 && x < 8)) x = p < 0.5 ? -6 : 6;
    double step = 1;
    for (int i = 0; i < 6 && std::abs(step) > 1e-12; ++i) {
        const double tail = 0.5 * std::erfc(-x / std::sqrt(2.0));
        const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * 3.14159265358979323846);
        step = std::clamp((tail - p) / density, -1.0, 1.0);
        x -= step;
    }
    return x;
}

namespace {

constexpr std::uint32_t kLevels = 4096;  // equally likely values

}  // namespace

std::vector<double> normal_levels() {
    constexpr std::uint32_t half = kLevels / 2;
    std::vector<double> upper(half);
    for (std::uint32_t i = 0; i < half; ++i) upper[i] = inverse_normal((half + i + 0.5) / kLevels);
    return upper;
}

std::vector<std::int8_t> make_noise_tile(std::span<const double> upper,
                                         double sigma,
                                         std::uint32_t seed,
                                         int overhang) {
    // Each of the equally likely values once, in an order drawn by the seed: the tile's own mean
    // and deviation are then exact.
    std::vector<std::int8_t> tile(kNoiseTile + static_cast<std::size_t>(overhang));
    for (std::uint32_t i = 0; i < kLevels / 2; ++i) {
        const double value = std::min(std::round(sigma * upper[i]), 127.0);
        for (std::uint32_t j = 0; j < kNoiseTile; j += kLevels) {
            tile[j + kLevels / 2 + i] = static_cast<std::int8_t>(value);
            tile[j + kLevels / 2 - 1 - i] = static_cast<std::int8_t>(-value);
        }
    }
    for (std::uint32_t i = kNoiseTile - 1; i > 0; --i) {
        const std::uint32_t j = static_cast<std::uint32_t>(
            (static_cast<std::uint64_t>(hash32(seed + i * 0x85EBCA6Bu)) * (i + 1)) >> 32);
        std::swap(tile[i], tile[j]);
    }
    for (int i = 0; i < overhang; ++i)
        tile[kNoiseTile + i] = tile[static_cast<std::size_t>(i) % kNoiseTile];
    return tile;
}

}  // namespace sonocase::runtime
