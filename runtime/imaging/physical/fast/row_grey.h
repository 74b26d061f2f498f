// SPDX-License-Identifier: Apache-2.0

// Rows of samples, from the envelope's power to grey.
#pragma once

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

// Haze, log compression and the lateral half of the post-filter.
void make_physical_grey(SimdTarget simd, const PhysicalGreyTask& task);

// The axial half of the post-filter, the grey map, and bytes.
void make_physical_shade(SimdTarget simd, const PhysicalShadeTask& task);

}  // namespace sonocase::runtime
