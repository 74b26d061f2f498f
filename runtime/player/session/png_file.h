// SPDX-License-Identifier: Apache-2.0

// Writes pictures as PNG files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "formats/base/result.h"

namespace sonocase::runtime::inline player_session {

// channels   1 (grey) or 3 (RGB)
// pixels     # width * height * channels, rows from the top
// copyright  UTF-8; goes into the file as its "Copyright" text (formats/bundle/case_bundle.h);
//            empty: none
// The file is written under a temporary name and renamed. Errors: it cannot be written.
Status write_png(const std::string& path,
                 int width,
                 int height,
                 int channels,
                 std::span<const std::uint8_t> pixels,
                 std::string_view copyright = {});
// The same in grey of 16 bits. pixels: # width * height.
Status write_png16(const std::string& path,
                   int width,
                   int height,
                   std::span<const std::uint16_t> pixels);

}  // namespace sonocase::runtime::inline player_session
