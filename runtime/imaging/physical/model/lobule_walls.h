// SPDX-License-Identifier: Apache-2.0

// Lobules of fat, and the septa between them. Each cell of a lattice holds the seed of a lobule, at
// a random place; a lobule is what lies nearer to its seed than to any other, where distances along
// the skin's normal count kLobuleFlat times, so that lobules are flat. Septa are the walls between
// neighbours: they meet, and enclose the lobule, as crossing plates do not. Sizes (a).
#pragma once

#include <cstdint>
#include <span>

#include "formats/base/geometry.h"

namespace sonocase::runtime::physical {

inline constexpr double kLobuleFlat = 2.5;
inline constexpr int kMostLobuleWalls = 13;  // of one cell

struct LobuleWall {
    Point3 middle;           // between the two seeds, and in the middle of the wall
    Vector3 normal;          // not unit
    double length_mm = 4;    // root of its two extents
    std::uint32_t draw = 0;  // random bits of the wall's own
};

// What of the walls is looked for.
struct LobuleView {
    Vector3 skin;           // its unit normal, or zero where it is not known
    Vector3 beam;           // unit
    double most_sin = 1;    // of the angle between a wall's normal and the beam
    Vector3 across;         // unit normal of the picture's plane
    double off_mm = 0;      // of the cell's middle from that plane, along it
    double reach_mm = 1e9;  // of walls from it: those further away may be left out
};

// Walls between the lobule of a cell and those of half of its neighbours, so that each wall belongs
// to one cell. corner: of cell 0 0 0. Returns how many of `out` it filled.
int find_lobule_walls(Int3 cell,
                      double cell_mm,
                      Point3 corner,
                      const LobuleView& view,
                      std::span<LobuleWall, kMostLobuleWalls> out);

}  // namespace sonocase::runtime::physical
