// SPDX-License-Identifier: Apache-2.0

// Pictures out as PNG.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "formats/base/result.h"

namespace sonocase::runtime {

// pixels: # width * height * channels, rows from the top; channels 1 (grey) or 3 (RGB).
// Written to a temporary name and renamed.
Status write_png(const std::string& path,
                 int width,
                 int height,
                 int channels,
                 std::span<const std::uint8_t> pixels);

}  // namespace sonocase::runtime
