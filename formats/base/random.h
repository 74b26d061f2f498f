// SPDX-License-Identifier: Apache-2.0

// Random numbers that are the same on every machine. Integers are exact; real numbers come from
// additions, multiplications and square roots alone.
//
// Source: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "formats/base/geometry.h"

namespace sonocase {

inline constexpr std::uint64_t kGoldenGamma = 0x9E3779B97F4A7C15ull;  // 2^64 / golden ratio, odd

constexpr std::uint64_t mix64(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

class RandomStream {
  public:
    explicit RandomStream(std::uint64_t seed) : state_(seed) {}
    std::uint64_t bits() { return mix64(state_ += kGoldenGamma); }
    // 0 .. count - 1. Small numbers come up more often by at most count / 2^64. count >= 1.
    std::size_t below(std::size_t count) { return static_cast<std::size_t>(bits() % count); }
    double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }  // [0, 1)
    double uniform(double low, double high) { return low + (high - low) * unit(); }
    // Uniform in the unit ball. By rejection: trigonometry would differ between machines.
    Vector3 in_ball() {
        for (;;) {
            const Vector3 v{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
            if (dot(v, v) <= 1) return v;
        }
    }
    Vector3 direction() {
        for (;;) {
            const Vector3 v = in_ball();
            if (dot(v, v) > 0.01) return v / std::sqrt(dot(v, v));
        }
    }

  private:
    std::uint64_t state_;
};

}  // namespace sonocase
