// SPDX-License-Identifier: Apache-2.0

// Seeded random shapes for the tests. A failing test prints the seed it was given.
#pragma once

#include <cstdint>
#include <random>

#include "formats/base/constants.h"
#include "formats/base/geometry.h"

namespace sonocase::testing {

class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double low, double high) {
        // Not std::uniform_real_distribution: its sequence differs between standard libraries.
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
    }
    double gaussian() {
        const double u = 1 - uniform(0, 1), v = uniform(0, 1);
        return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
    }
    Vector3 direction() { return normalized({gaussian(), gaussian(), gaussian()}); }
    Matrix3 rotation() {
        return rotation_from_quaternion({gaussian(), gaussian(), gaussian(), gaussian()});
    }
    Point3 point(double half_width) {
        return {uniform(-half_width, half_width), uniform(-half_width, half_width),
                uniform(-half_width, half_width)};
    }
    Rigid rigid(double half_width) {
        const Point3 p = point(half_width);
        return {rotation(), {p.x, p.y, p.z}};
    }

  private:
    std::mt19937_64 engine_;
};

}  // namespace sonocase::testing
