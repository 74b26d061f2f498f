// SPDX-License-Identifier: Apache-2.0

// Random numbers and angles of the Doppler modes: integers, additions, multiplications, divisions
// and square roots alone, so that every machine gets the same bits.
#pragma once

#include <cmath>
#include <cstdint>

namespace sonocase::runtime::doppler {

inline std::uint32_t mixed(std::uint32_t x) {
    x ^= x >> 16;
    x *= 0x7FEB352Du;
    x ^= x >> 15;
    x *= 0x846CA68Bu;
    return x ^ x >> 16;
}
inline std::uint32_t mixed(std::uint32_t a, std::uint32_t b) {
    return mixed(a * 0x9E3779B9u + mixed(b + 0x85EBCA6Bu));
}

// Approximately normal, mean 0, deviation 1: the sum of eight bytes (excess kurtosis -0.15).
inline float normal(std::uint32_t key) {
    const std::uint32_t a = mixed(key), b = mixed(a + 0x68E31DA4u), even = 0x00FF00FFu;
    // Two sums side by side, of at most 4 x 255 each.
    const std::uint32_t pairs = (a & even) + (a >> 8 & even) + (b & even) + (b >> 8 & even);
    const std::uint32_t sum = (pairs & 0xFFFFu) + (pairs >> 16);
    return (static_cast<float>(static_cast<std::int32_t>(sum)) - 1020.0f) * (1 / 209.0238f);
}

// arg(x + iy) / (2 pi), in [-1/2, 1/2]; 0 at the origin. Within 2e-5.
inline float turns_of(float y, float x) {
    const float ax = std::abs(x), ay = std::abs(y), low = ax < ay ? ax : ay,
                high = ax < ay ? ay : ax;
    if (!(high > 0)) return 0;
    const float t = low / high, s = t * t;
    // Abramowitz, Stegun 4.4.49, over 2 pi.
    float turn =
        t *
        (0.15915428f +
         s * (-0.05302968f +
              s * (0.03145130f +
                   s * (-0.02096630f + s * (0.01258300f + s * (-0.00528420f + s * 0.00110900f))))));
    if (ay > ax) turn = 0.25f - turn;
    if (x < 0) turn = 0.5f - turn;
    return y < 0 ? -turn : turn;
}

}  // namespace sonocase::runtime::doppler
