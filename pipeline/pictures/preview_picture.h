// SPDX-License-Identifier: Apache-2.0

// The preview picture that a bundle contains: three cuts through the body.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline pictures {

struct Picture {
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> rgb;  // # 3 * width * height, row by row from the top
};

// Axial, coronal and sagittal cuts side by side, each through the middle of the body's box, at one
// scale, about 256 pixels high. The cuts run along the grid's axes, whatever
// the direction of the head. Labels in their colours, darker at their borders.
Picture preview_picture(const LabelVolume& volume);

// The picture as a PNG file in memory; the same picture gives the same bytes.
std::vector<std::uint8_t> png_of(const Picture& picture);

}  // namespace sonocase::pipeline::inline pictures
