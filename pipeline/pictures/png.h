// SPDX-License-Identifier: Apache-2.0

// Pictures as PNG files in memory.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline pictures {

// Rows from the top down, 8 bits per channel; # pixels = width_px * height_px, times 3 for RGB. The
// same pixels give the same bytes; a picture without pixels gives none.
std::vector<std::uint8_t> png_from_grey(const std::uint8_t* pixels, int width_px, int height_px);
std::vector<std::uint8_t> png_from_rgb(const std::uint8_t* pixels, int width_px, int height_px);

struct GreyPicture {
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> pixels;  // rows from the top down
};

// Colours become grey. Error: bytes that are not a PNG, or one of more than 8192 pixels an edge.
Result<GreyPicture> grey_from_png(std::span<const std::uint8_t> bytes);

}  // namespace sonocase::pipeline::inline pictures
