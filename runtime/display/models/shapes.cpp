// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/models/shapes.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

constexpr double kPi = 3.14159265358979323846;

}  // namespace

void loft(const std::vector<Ring>& rings,
          double exponent,
          std::vector<Vertex>& vertices,
          std::vector<std::uint32_t>& indices) {
    constexpr int kAround = 32;
    const auto base = static_cast<std::uint32_t>(vertices.size());
    for (std::size_t r = 0; r < rings.size(); ++r) {
        const Ring& before = rings[r > 0 ? r - 1 : r];
        const Ring& after = rings[r + 1 < rings.size() ? r + 1 : r];
        for (int i = 0; i < kAround; ++i) {
            const double a = 2 * kPi * i / kAround, c = std::cos(a), s = std::sin(a);
            const double power = 2 / exponent;
            const double x = std::copysign(std::pow(std::abs(c), power), c);
            const double y = std::copysign(std::pow(std::abs(s), power), s);
            const double widening =
                0.5 * (after.half_x - before.half_x + after.half_y - before.half_y);
            const Vector3 n = normalized(Vector3{c, s * rings[r].half_x / rings[r].half_y,
                                                 -widening / std::max(after.z - before.z, 1e-3)});
            vertices.push_back(
                {{float(x * rings[r].half_x), float(y * rings[r].half_y), float(rings[r].z)},
                 {float(n.x), float(n.y), float(n.z)},
                 {0, 0}});
        }
    }
    const auto at = [&](std::size_t ring, int i) {
        return base + static_cast<std::uint32_t>(ring) * kAround +
               static_cast<std::uint32_t>(i % kAround);
    };
    for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
        for (int i = 0; i < kAround; ++i) {
            for (std::uint32_t v : {at(r, i), at(r, i + 1), at(r + 1, i + 1), at(r, i),
                                    at(r + 1, i + 1), at(r + 1, i)}) {
                indices.push_back(v);
            }
        }
    }
    for (std::size_t r : {std::size_t{0}, rings.size() - 1}) {
        const float up = r == 0 ? -1.0f : 1.0f;
        const auto middle = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back({{0, 0, float(rings[r].z)}, {0, 0, up}, {0, 0}});
        for (int i = 0; i < kAround; ++i) {
            for (std::uint32_t v : {middle, at(r, i), at(r, i + 1)}) indices.push_back(v);
        }
    }
}

void sphere(std::vector<Vertex>& vertices, std::vector<std::uint32_t>& indices) {
    constexpr int kRows = 10, kAround = 20;
    for (int r = 0; r <= kRows; ++r) {
        for (int i = 0; i <= kAround; ++i) {
            const double b = kPi * r / kRows, a = 2 * kPi * i / kAround;
            const float n[3] = {float(std::sin(b) * std::cos(a)), float(std::sin(b) * std::sin(a)),
                                float(std::cos(b))};
            vertices.push_back({{n[0], n[1], n[2]}, {n[0], n[1], n[2]}, {0, 0}});
        }
    }
    for (int r = 0; r < kRows; ++r) {
        for (int i = 0; i < kAround; ++i) {
            const auto p = static_cast<std::uint32_t>(r * (kAround + 1) + i);
            for (std::uint32_t v :
                 {p, p + 1, p + kAround + 2, p, p + kAround + 2, p + kAround + 1}) {
                indices.push_back(v);
            }
        }
    }
}

}  // namespace sonocase::runtime
