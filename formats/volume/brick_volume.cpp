// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/brick_volume.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <map>

namespace sonocase {

template <class T>
BrickVolume<T> bricks_from_dense(std::span<const T> dense, Int3 size) {
    assert(dense.size() == static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y) *
                               static_cast<std::size_t>(size.z));
    BrickVolume<T> out;
    out.size = size;
    const Int3 n = brick_count(size);
    out.table.reserve(static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) *
                      static_cast<std::size_t>(n.z));
    std::map<T, std::uint32_t> uniform_index;
    std::array<T, kBrickVoxels> brick;
    for (int bz = 0; bz < n.z; ++bz) {
        for (int by = 0; by < n.y; ++by) {
            for (int bx = 0; bx < n.x; ++bx) {
                T* to = brick.data();
                for (int z = 0; z < kBrickEdge; ++z) {
                    const std::size_t k =
                        static_cast<std::size_t>(std::min(bz * kBrickEdge + z, size.z - 1));
                    for (int y = 0; y < kBrickEdge; ++y) {
                        const std::size_t j =
                            static_cast<std::size_t>(std::min(by * kBrickEdge + y, size.y - 1));
                        const T* row =
                            dense.data() + static_cast<std::size_t>(size.x) *
                                               (j + static_cast<std::size_t>(size.y) * k);
                        for (int x = 0; x < kBrickEdge; ++x) {
                            *to++ = row[std::min(bx * kBrickEdge + x, size.x - 1)];
                        }
                    }
                }
                const bool alike =
                    std::all_of(brick.begin(), brick.end(), [&](T v) { return v == brick[0]; });
                if (alike) {
                    const auto [it, added] = uniform_index.try_emplace(
                        brick[0], static_cast<std::uint32_t>(out.uniform.size()));
                    if (added) out.uniform.push_back(brick[0]);
                    out.table.push_back(kUniformBrick | it->second);
                } else {
                    out.table.push_back(static_cast<std::uint32_t>(out.pool.size() / kBrickVoxels));
                    out.pool.insert(out.pool.end(), brick.begin(), brick.end());
                }
            }
        }
    }
    return out;
}

template <class T>
std::vector<T> dense_from_bricks(const BrickVolume<T>& bricks) {
    std::vector<T> dense;
    dense.reserve(static_cast<std::size_t>(bricks.size.x) *
                  static_cast<std::size_t>(bricks.size.y) *
                  static_cast<std::size_t>(bricks.size.z));
    for (int k = 0; k < bricks.size.z; ++k) {
        for (int j = 0; j < bricks.size.y; ++j) {
            for (int i = 0; i < bricks.size.x; ++i) dense.push_back(bricks.at(i, j, k));
        }
    }
    return dense;
}

#define SONOCASE_BRICKS(T)                                                  \
    template BrickVolume<T> bricks_from_dense<T>(std::span<const T>, Int3); \
    template std::vector<T> dense_from_bricks<T>(const BrickVolume<T>&);
SONOCASE_BRICKS(std::uint8_t)
SONOCASE_BRICKS(std::int8_t)
SONOCASE_BRICKS(std::uint32_t)
#undef SONOCASE_BRICKS

}  // namespace sonocase
