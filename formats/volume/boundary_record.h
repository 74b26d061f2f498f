// SPDX-License-Identifier: Apache-2.0

// Where the surface between two labels runs through a voxel's neighbourhood, in four bytes.
//
//     d(x) = distance + normal . (x - x_voxel)
//     label at x: the voxel's own label where d(x) >= 0, otherwise the second label
//
// x in voxels of the cooked grid; the normal is a unit vector that points into the voxel's own
// label. Packed: bits 0-7 second label, 8-15 distance (signed, 1/48 voxel, so +-2.6 voxels), 16-23
// and 24-31 the normal in octahedral coordinates (signed, 1/127). Rounding: 0.01 voxel and 1 degree
// at most. Voxels with no interface nearby hold kNoBoundary. Constant time; meant for the frame
// loop.
#pragma once

#include <cstdint>

#include "formats/base/geometry.h"

namespace sonocase {

inline constexpr std::uint32_t kNoBoundary = 0x000000FFu;
inline constexpr double kBoundaryStepsPerVoxel = 48.0;

struct BoundaryRecord {
    std::uint8_t second_label = 0;  // 0..254
    double distance_vx = 0;         // clamped to +-127/48 when packed
    Vector3 normal{0, 0, 1};        // unit
};

std::uint32_t pack_boundary(const BoundaryRecord& record);
BoundaryRecord unpack_boundary(std::uint32_t packed);  // packed != kNoBoundary

}  // namespace sonocase
