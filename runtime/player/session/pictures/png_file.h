// SPDX-License-Identifier: Apache-2.0

// Writes pictures as PNG files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "formats/base/result.h"

namespace sonocase::runtime {

// pixels    # width * height * channels, rows from the top channels  1 (grey) or 3 (RGB) copyright
// UTF-8; not empty: goes into the file as its "Copyright" text (formats/bundle/attribution.h) The
// file is written under a temporary name and renamed. Errors: it cannot be written.
Status write_png(const std::string& path,
                 int width,
                 int height,
                 int channels,
                 std::span<const std::uint8_t> pixels,
                 std::string_view copyright = {});
// Grey of 16 bits: # width * height.
Status write_png16(const std::string& path,
                   int width,
                   int height,
                   std::span<const std::uint16_t> pixels);

}  // namespace sonocase::runtime
