// SPDX-License-Identifier: Apache-2.0

// Example images from files: PNG, TIFF, DICOM frames and every other format of OpenImageIO.
#pragma once

#include <optional>
#include <string>

#include "formats/base/result.h"
#include "pipeline/texture/example_image.h"

namespace sonocase::pipeline::inline texture {

struct PixelRectangle {
    int x = 0, y = 0;  // top left corner
    int width = 0, height = 0;
};

struct ReadExampleOptions {
    std::optional<PixelRectangle> rectangle;  // part to read; empty: the whole image
    std::string mask_path;  // image of the same size; pixels above half are part of the example
    int frame = 0;          // of a file with several images
};

// Grey in [0, 255] from 8 or 16 bits, or from floating point in [0, 1] or [0, 255]. 16-bit files
// with only 8, 10 or 12 significant bits are scaled by those bits. Colour becomes luminance (0.299,
// 0.587, 0.114). Not used are pixels of strong colour, which do not occur in a grey image,
// transparent pixels and non-finite ones. Adds a sentence to `notes` (may be null) on each of
// these.
//
// Error: a missing or unreadable file, a rectangle outside the image, a mask of another size.
Result<ExampleImage> read_example(const std::string& path,
                                  const ReadExampleOptions& options = {},
                                  std::vector<std::string>* notes = nullptr);

}  // namespace sonocase::pipeline::inline texture
