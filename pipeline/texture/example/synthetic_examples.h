// SPDX-License-Identifier: Apache-2.0

// Example images made by a formula, for cases that come without real ones (the analytic torso).
//
// Organs: log-compressed Rayleigh speckle with the axial and lateral widths measured on real images
// (docs/textures.md). Muscle: thin bright fibres along a slant. Fat: septa along the skin. They
// carry no licence, need no file, and are not a substitute for real ultrasound.
#pragma once

#include <cstdint>
#include <string_view>

#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

// Example for one of the built-in texture names; a name that is not known gets plain speckle.
// width, height in pixels, >= 8. Same bytes for the same seed.
ExampleImage synthetic_example(std::string_view texture,
                               int width = 160,
                               int height = 128,
                               std::uint64_t seed = 1);

}  // namespace sonocase::pipeline
