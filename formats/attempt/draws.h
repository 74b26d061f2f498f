// SPDX-License-Identifier: Apache-2.0

// Random numbers of an attempt: the same on every machine. Internal to attempts.
#pragma once

#include <cmath>
#include <cstdint>

#include "formats/base/geometry.h"

namespace sonocase {

// SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).
class Draws {
  public:
    explicit Draws(std::uint64_t seed) : state_(seed) {}
    double uniform(double low, double high) {
        state_ += 0x9E3779B97F4A7C15ull;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
        z ^= z >> 31;
        return low + (high - low) * (static_cast<double>(z >> 11) * 0x1p-53);
    }
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
