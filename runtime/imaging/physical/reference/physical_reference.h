// SPDX-License-Identifier: Apache-2.0

// The slow, obvious renderer of model `physical`: double precision, one sample after the other,
// each line the formula itself. It defines what the fast renderer has to show. Cost: some 100 ns
// per sample and effect; memory for a dozen planes of samples.
#pragma once

#include <cstdint>
#include <span>

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime {

// pixels: # width * height of the geometry.
void render_physical_reference(const PhysicalScene& scene,
                               const ScanGeometry& geometry,
                               const physical::Tables& tables,
                               const PhysicalNoise& noise,
                               const PhysicalFrame& frame,
                               std::span<std::uint8_t> pixels);

}  // namespace sonocase::runtime
