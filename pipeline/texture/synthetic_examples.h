// SPDX-License-Identifier: Apache-2.0

// Example images computed by a formula, for cases without real ones (the analytic torso).
//
// Organs: log-compressed Rayleigh speckle with the axial and lateral widths measured on real images
// (docs/textures.md). Muscle: thin bright fibres at a slant. Fat: septa parallel to the skin. They
// need no licence and no file, and are not a substitute for real ultrasound.
#pragma once

#include <cstdint>
#include <string_view>

#include "pipeline/texture/example_image.h"

namespace sonocase::pipeline::inline texture {

// Example for one of the built-in texture names; for any other name, plain speckle.
// width, height in pixels, >= 8. Same bytes for the same seed.
ExampleImage synthetic_example(std::string_view texture,
                               int width = 160,
                               int height = 128,
                               std::uint64_t seed = 1);

}  // namespace sonocase::pipeline::inline texture
