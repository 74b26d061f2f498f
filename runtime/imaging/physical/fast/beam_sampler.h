// SPDX-License-Identifier: Apache-2.0

// The first pass of model `physical`: the echoes and the light at every sample of a block of beams,
// and the needle over them.
#pragma once

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"

namespace sonocase::runtime {

// Fills echoes, light and, from tail_from on, tail; reports what it met. Cost: about 5 ns per
// sample of one beam with AVX-512.
void sample_beam_block(SimdTarget simd, PhysicalBlock& block);

// Draws the needle over a sampled block of beams. Adds the shaft to echoes and its tail to tail,
// and dims light behind it. Samples [row_begin, row_end) can show it. Cost: 2 ns per sample from
// row_begin on.
void draw_physical_needle(
    SimdTarget simd, PhysicalBlock& block, const NeedleRow& needle, int row_begin, int row_end);

}  // namespace sonocase::runtime
