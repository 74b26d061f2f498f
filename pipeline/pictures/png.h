// SPDX-License-Identifier: Apache-2.0

// Pictures as PNG files in memory.
#pragma once

#include <cstdint>
#include <vector>

namespace sonocase::pipeline::inline pictures {

// Rows from the top down, 8 bits per channel; # pixels = width_px * height_px, times 3 for RGB. The
// same pixels give the same bytes; a picture without pixels gives none.
std::vector<std::uint8_t> png_from_grey(const std::uint8_t* pixels, int width_px, int height_px);
std::vector<std::uint8_t> png_from_rgb(const std::uint8_t* pixels, int width_px, int height_px);

}  // namespace sonocase::pipeline::inline pictures
