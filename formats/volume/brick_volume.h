// SPDX-License-Identifier: Apache-2.0

// A volume kept in bricks of 4 x 4 x 4 voxels. A brick whose voxels are all equal costs only its
// table entry, so that the air around a torso and the inside of an organ are nearly free.
//
// table    one entry per brick, x fastest
//          bit 31 clear: number of the brick in `pool`; its 64 values start at 64 * entry,
//          x fastest
//          bit 31 set: the brick is uniform, and the other bits are an index into `uniform`
//
// Voxels beyond `size` that pad the last bricks repeat their nearest neighbour inside. Reading a
// voxel is two dependent loads; both may run in the frame loop.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/memory.h"

namespace sonocase {

inline constexpr int kBrickEdge = 4;
inline constexpr int kBrickVoxels = kBrickEdge * kBrickEdge * kBrickEdge;
inline constexpr std::uint32_t kUniformBrick = 0x80000000u;

inline Int3 brick_count(Int3 size) {
    return {(size.x + kBrickEdge - 1) / kBrickEdge, (size.y + kBrickEdge - 1) / kBrickEdge,
            (size.z + kBrickEdge - 1) / kBrickEdge};
}

template <class T>  // std::uint8_t (labels), std::int8_t (echo offsets), std::uint32_t (boundaries)
struct BrickVolume {
    Int3 size{0, 0, 0};              // voxels
    RawVector<std::uint32_t> table;  // # product of brick_count(size)
    std::vector<T> uniform;          // distinct values of uniform bricks
    RawVector<T> pool;               // 64 values per stored brick

    // i, j, k: inside. Unsigned: a division by the edge is a shift then.
    T at(int i, int j, int k) const {
        constexpr unsigned kEdge = kBrickEdge;
        const auto x = static_cast<unsigned>(i), y = static_cast<unsigned>(j),
                   z = static_cast<unsigned>(k);
        const auto along = [](int n) { return (static_cast<unsigned>(n) + kEdge - 1) / kEdge; };
        const std::size_t brick =
            x / kEdge +
            std::size_t{along(size.x)} * (y / kEdge + std::size_t{along(size.y)} * (z / kEdge));
        const std::uint32_t entry = table[brick];
        if (entry & kUniformBrick) return uniform[entry & ~kUniformBrick];
        return pool[static_cast<std::size_t>(entry) * kBrickVoxels +
                    (x % kEdge + kEdge * (y % kEdge) + kEdge * kEdge * (z % kEdge))];
    }
};

// Packs a dense volume (x fastest, # product of size). Same input, same bytes. Cost: one pass.
template <class T>
BrickVolume<T> bricks_from_dense(std::span<const T> dense, Int3 size);
// Unpacks to dense.
template <class T>
std::vector<T> dense_from_bricks(const BrickVolume<T>& bricks);

}  // namespace sonocase
