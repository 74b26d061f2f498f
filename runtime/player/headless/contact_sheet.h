// SPDX-License-Identifier: Apache-2.0

// One picture of a whole run: up to twelve frames, evenly spread over it, at a quarter of their
// area, each with its time and the place of the probe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

class ContactSheet {
  public:
    // For a run of `frames` frames of width x height pixels; frames >= 1, width and height >= 2.
    ContactSheet(int frames, int width, int height);

    // Adds frame i of the run; any order. A frame that is not on the sheet costs nothing. caption:
    // digits, signs and the letters of "MS", written into the lower left corner where it fits.
    void add(int i, std::span<const std::uint8_t> pixels, std::string_view caption = {});

    Status write(const std::string& path, std::string_view copyright = {}) const;

  private:
    void write_caption(int left, int bottom, std::string_view caption);

    int frames_;
    int source_width_;
    int width_, height_;  // of a frame on the sheet
    int shown_, columns_, rows_;
    std::vector<std::uint8_t> sheet_;
};

}  // namespace sonocase::runtime
