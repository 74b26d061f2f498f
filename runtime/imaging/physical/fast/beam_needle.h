// SPDX-License-Identifier: Apache-2.0

// The needle over a sampled block of beams.
#pragma once

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

// Adds the shaft to echoes and its tail to tail, and dims light behind it. Samples [row_begin,
// row_end) can show it. Cost: 2 ns per sample from row_begin on.
void draw_physical_needle(
    SimdTarget simd, PhysicalBlock& block, const NeedleRow& needle, int row_begin, int row_end);

}  // namespace sonocase::runtime
