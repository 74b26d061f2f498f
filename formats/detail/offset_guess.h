// A guess at an echo offset by its neighbours in the brick, to the left of it and in front of it.
// A brick is `edge` values an edge here: 4 voxels, or 2 cells of 2 x 2 x 2 alike voxels. Across the
// brick's left and front faces only bricks of the same block count. For the .cpp files of formats/.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "formats/brick_volume.h"

namespace sonocase::detail {

class OffsetGuess {
  public:
    // left, front: the 64 values of those bricks, or null at the border.
    OffsetGuess(int edge, const std::int8_t* left, const std::int8_t* front) : edge_(edge) {
        const int step = kBrickEdge / edge;
        for (int k = 0; k < edge; ++k) {
            for (int j = 0; j < edge; ++j) {
                const auto face = static_cast<std::size_t>(step * (kBrickEdge * j + 16 * k));
                left_[at(j, k)] = left ? left[face + kBrickEdge - 1] : 0;
                front_[at(j, k)] =
                    front ? front[static_cast<std::size_t>(step * (j + 16 * k)) + 12] : 0;
            }
        }
    }
    // values: of the brick, edge^3, those before (i, j, k) known.
    std::uint8_t operator()(const std::int8_t* values, int i, int j, int k) const {
        const auto value = [&](int x, int y, int z) -> int {
            return values[static_cast<std::size_t>(x + edge_ * (y + edge_ * z))];
        };
        const int a = i > 0 ? value(i - 1, j, k) : left_[at(j, k)];
        const int b = j > 0 ? value(i, j - 1, k) : front_[at(i, k)];
        const int ab = i > 0   ? (j > 0 ? value(i - 1, j - 1, k) : front_[at(i - 1, k)])
                       : j > 0 ? left_[at(j - 1, k)]
                               : (a + b) / 2;
        // Of three values the middle one: a, b, and the plane through them.
        const int plane = std::max(std::min(a, b), std::min(std::max(a, b), a + b - ab));
        const int guess = k == 0 ? plane : (plane + value(i, j, k - 1)) >> 1;
        // Values of one label are whole dB apart.
        return static_cast<std::uint8_t>(a + 4 * ((guess - a + 2) >> 2));
    }

  private:
    static std::size_t at(int u, int v) { return static_cast<std::size_t>(u + kBrickEdge * v); }
    int edge_;
    std::array<std::int8_t, 16> left_{}, front_{};
};

}  // namespace sonocase::detail
