// SPDX-License-Identifier: Apache-2.0

// One picture of a whole run: up to twelve frames, evenly spread over it, at a quarter of their
// area.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

class ContactSheet {
  public:
    // For a run of `frames` frames of width x height pixels; frames >= 1, width and height >= 2.
    ContactSheet(int frames, int width, int height);

    // Adds frame i of the run; any order. A frame that is not on the sheet costs nothing.
    void add(int i, std::span<const std::uint8_t> pixels);

    Status write(const std::string& path) const;

  private:
    int frames_;
    int source_width_;
    int width_, height_;  // of a frame on the sheet
    int shown_, columns_, rows_;
    std::vector<std::uint8_t> sheet_;
};

}  // namespace sonocase::runtime
