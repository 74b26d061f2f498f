// SPDX-License-Identifier: Apache-2.0

// Rows of samples: filtered across the beams and along them to the envelope's power, and from there
// to grey.
#pragma once

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"

namespace sonocase::runtime {

// The light of a row, after neighbouring beams have shared it on the way down.
void spread_light_row(SimdTarget simd, const PhysicalSpreadTask& task);

// Light of the aperture times echoes, point spread across the beams, clutter and noise.
void filter_row_across(SimdTarget simd, const PhysicalRowTask& task);

// Point spread along the beams and gain; the envelope's power.
void make_power_row(SimdTarget simd, const PhysicalPowerTask& task);

// Haze, log compression and the lateral half of the post-filter.
void make_physical_grey(SimdTarget simd, const PhysicalGreyTask& task);

// The axial half of the post-filter, the grey map, and bytes.
void make_physical_shade(SimdTarget simd, const PhysicalShadeTask& task);

}  // namespace sonocase::runtime
