// SPDX-License-Identifier: Apache-2.0

// Writes a film of at most 256 colours as an animated GIF, which browsers and slides play without
// anything else.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime::inline player_session {

// colours    red, green, blue of each value of a pixel
// frames     each # width * height, rows from the top; at least one
// delays_cs  # frames, hundredths of a second until the next; the film starts over at its end
// Written under a temporary name and renamed. Errors: it cannot be written.
using GifColours = std::array<std::array<std::uint8_t, 3>, 256>;
Status write_gif(const std::string& path,
                 int width,
                 int height,
                 const GifColours& colours,
                 const std::vector<std::vector<std::uint8_t>>& frames,
                 const std::vector<int>& delays_cs);

}  // namespace sonocase::runtime::inline player_session
