// SPDX-License-Identifier: Apache-2.0

// The first pass of model `physical`: the echoes and the light at every sample of a block of beams.
#pragma once

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

// Fills echoes, light and, from tail_from on, tail; reports what it met. Cost: about 5 ns per
// sample of one beam with AVX-512.
void sample_beam_block(SimdTarget simd, PhysicalBlock& block);

}  // namespace sonocase::runtime
