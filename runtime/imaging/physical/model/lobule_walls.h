// SPDX-License-Identifier: Apache-2.0

// Lobules of fat, and the septa between them. Each cell of a lattice holds the seed of a lobule, at
// a random place; a lobule is what lies nearer to its seed than to any other, where distances along
// the skin's normal count kLobuleFlat times, so that lobules are flat. Septa are the walls between
// neighbours: they meet and enclose the lobule, which crossing plates do not. The sizes are
// assumed.
#pragma once

#include <cstdint>
#include <span>

#include "formats/base/geometry.h"
#include "runtime/imaging/core/noise.h"

namespace sonocase::runtime::physical {

inline constexpr std::uint32_t kHashX = 0x9E3779B1u, kHashY = 0x85EBCA77u, kHashZ = 0xC2B2AE3Du;

// Random bits of a lattice's cell, from which its content is drawn.
inline std::uint32_t hash_of_cell(int i, int j, int k) {
    return hash32(static_cast<std::uint32_t>(i) * kHashX ^ static_cast<std::uint32_t>(j) * kHashY ^
                  static_cast<std::uint32_t>(k) * kHashZ);
}

inline constexpr double kLobuleFlat = 2.5;
inline constexpr int kMaxLobuleWalls = 13;  // per cell

struct LobuleWall {
    Point3 middle;           // between the two seeds, and in the middle of the wall
    Vector3 normal;          // not unit
    double length_mm = 4;    // root of its two extents
    std::uint32_t draw = 0;  // random bits of the wall
};

// Which walls are searched for.
struct LobuleView {
    Vector3 skin;           // unit normal of the skin, or zero where it is not known
    Vector3 beam;           // unit
    double max_sin = 1;     // limit for the sine of the angle between a wall's normal and the beam
    Vector3 across;         // unit normal of the picture's plane
    double off_mm = 0;      // signed distance of the cell's middle from that plane
    double reach_mm = 1e9;  // walls further from the plane may be left out
};

// Finds the walls between the lobule of a cell and those of half of its neighbours, so that each
// wall belongs to one cell. corner: corner of cell 0 0 0. Returns how many of `out` it filled.
int find_lobule_walls(Int3 cell,
                      double cell_mm,
                      Point3 corner,
                      const LobuleView& view,
                      std::span<LobuleWall, kMaxLobuleWalls> out);

}  // namespace sonocase::runtime::physical
