// SPDX-License-Identifier: Apache-2.0

// The labels of a brick volume along some lines at once, vectorised.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "formats/base/geometry.h"
#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_samples.h"

namespace sonocase::runtime::press {

// A BrickVolume's table and pool as words; `uniform` holds a word for each value.
struct BrickLines {
    const std::int32_t *table = nullptr, *uniform = nullptr, *pool = nullptr;
    Int3 size, bricks;
};

// start + t * step, in voxels.
struct VoxelLines {
    int count = 0;
    alignas(64) float start[3][kMaxPressLines] = {};
    alignas(64) float step[3][kMaxPressLines] = {};
};

// Finds the label of the voxel nearest to each place; beyond the volume its border goes on. label:
// # t x # lines. The same on every instruction set. Cost: 1 ns per place with AVX2.
void labels_along(SimdTarget simd,
                  const BrickLines& bricks,
                  const VoxelLines& lines,
                  std::span<const float> t,
                  std::uint8_t* label);

}  // namespace sonocase::runtime::press
