// SPDX-License-Identifier: Apache-2.0

// JPEG pictures of a camera as grey values, with libjpeg-turbo. Colours are not even unpacked.
// The library is opened when the first reader is made. No files.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/base/result.h"

namespace sonocase {

struct GreyImage {
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> pixels;  // row by row
};

class GreyJpegReader {
  public:
    // Error: the library is not installed.
    static Result<GreyJpegReader> create();
    GreyJpegReader(GreyJpegReader&&) noexcept;
    GreyJpegReader& operator=(GreyJpegReader&&) noexcept;
    ~GreyJpegReader();

    // Into `image`, whose memory is used again. False: no JPEG, or one that is cut off or larger
    // than 8192 pixels on a side; `image` is then undefined. Cost: 3 ms for 1280 x 720.
    bool read(std::span<const std::uint8_t> jpeg, GreyImage& image);

  private:
    struct State;
    explicit GreyJpegReader(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace sonocase
