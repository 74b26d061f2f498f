// SPDX-License-Identifier: Apache-2.0

// The frames of a run as files of one folder: frame_00000.png and so on, and contact-sheet.png.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "formats/base/result.h"
#include "runtime/player/headless/contact_sheet.h"

namespace sonocase::runtime {

class FrameFiles {
  public:
    // Makes the folder. Error: it cannot be made.
    static Result<std::unique_ptr<FrameFiles>> in(const std::string& folder);

    // Before the first frame. The sheet is left out for frames of less than 2 x 2 pixels.
    void begin(int frames, int width_px, int height_px);
    // pixels: # width_px * height_px, grey. Frames may come in any order.
    Status add(int frame, std::span<const std::uint8_t> pixels);
    Status finish();  // writes the sheet

  private:
    explicit FrameFiles(std::string folder) : folder_(std::move(folder)) {}

    std::string folder_;
    int width_px_ = 0, height_px_ = 0;
    std::unique_ptr<ContactSheet> sheet_;
};

}  // namespace sonocase::runtime
