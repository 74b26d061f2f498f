// SPDX-License-Identifier: Apache-2.0

// Ultrasound of a case for covers and sheets. The player beside this program draws it, because the
// pipeline has no renderer.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline exporting {

struct UltrasoundView {
    std::string exercise;           // empty: the first
    std::string tracker = "mouse";  // as sonoplay takes it: where the probe and needle are
    int width_px = 416, height_px = 260;
};

// PNG of the view's first picture. path: of the bundle. Errors: the player is not there, or fails.
// Cost: the player's start and one picture, some 0.5 s at 1 mm.
Result<std::vector<std::uint8_t>> ultrasound_png(const std::string& path,
                                                 const UltrasoundView& view);

}  // namespace sonocase::pipeline::inline exporting
