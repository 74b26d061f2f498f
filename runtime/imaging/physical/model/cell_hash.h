// SPDX-License-Identifier: Apache-2.0

// Random bits of a lattice's cell, from which what lies in it is drawn.
#pragma once

#include <cstdint>

#include "runtime/imaging/noise/noise.h"

namespace sonocase::runtime::physical {

inline constexpr std::uint32_t kHashX = 0x9E3779B1u, kHashY = 0x85EBCA77u, kHashZ = 0xC2B2AE3Du;

inline std::uint32_t hash_of_cell(int i, int j, int k) {
    return hash32(static_cast<std::uint32_t>(i) * kHashX ^ static_cast<std::uint32_t>(j) * kHashY ^
                  static_cast<std::uint32_t>(k) * kHashZ);
}

}  // namespace sonocase::runtime::physical
