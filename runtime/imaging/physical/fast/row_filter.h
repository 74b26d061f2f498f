// SPDX-License-Identifier: Apache-2.0

// Rows of samples, filtered across the beams and along them.
#pragma once

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

// Light of a row, which its neighbours above share.
void spread_light_row(SimdTarget simd, const PhysicalSpreadTask& task);

// Light of the aperture times echoes, point spread across the beams, clutter and noise.
void filter_row_across(SimdTarget simd, const PhysicalRowTask& task);

// Point spread along the beams and gain; the envelope's power.
void make_power_row(SimdTarget simd, const PhysicalPowerTask& task);

}  // namespace sonocase::runtime
