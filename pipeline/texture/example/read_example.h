// SPDX-License-Identifier: Apache-2.0

// Example images from files: PNG, TIFF, DICOM frames and whatever else OpenImageIO reads.
#pragma once

#include <optional>
#include <string>

#include "formats/base/result.h"
#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

struct PixelRectangle {
    int x = 0, y = 0;  // top left corner
    int width = 0, height = 0;
};

struct ReadExampleOptions {
    std::optional<PixelRectangle> rectangle;  // part to take; the whole image without
    std::string mask_path;  // image of the same size: pixels above half are part of the example
    int frame = 0;          // of a file with several images
};

// Grey in [0, 255] from 8 or 16 bits, or from floating point in [0, 1] or [0, 255]. 16-bit files
// that use only 8, 10 or 12 of their bits are scaled by the bits that they use. Colour becomes
// luminance (0.299, 0.587, 0.114), and pixels of strong colour, which no grey scale shows, are left
// out of use, as are transparent and non-finite ones. `notes` (may be null) gets a sentence on each
// of these. Error: missing or unreadable file, rectangle outside the image, mask of another size.
Result<ExampleImage> read_example(const std::string& path,
                                  const ReadExampleOptions& options = {},
                                  std::vector<std::string>* notes = nullptr);

}  // namespace sonocase::pipeline
