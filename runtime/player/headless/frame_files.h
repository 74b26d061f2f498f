// SPDX-License-Identifier: Apache-2.0

// The frames of a run as files of one folder: frame_00000.png and so on, and contact-sheet.png.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "runtime/player/headless/contact_sheet.h"

namespace sonocase::runtime {

class FrameFiles {
  public:
    // Makes the folder. Error: it cannot be made.
    static Result<std::unique_ptr<FrameFiles>> in(const std::string& folder);

    // Text that goes into every picture: whose anatomy it shows.
    void set_copyright(std::string text) { copyright_ = std::move(text); }
    // Before the first frame. The sheet is left out for frames of less than 2 x 2 pixels.
    void begin(int frames, int width_px, int height_px);
    // pixels: # width_px * height_px, grey. Frames may come in any order. caption: on the sheet.
    Status add(int frame, std::span<const std::uint8_t> pixels, std::string_view caption = {});
    // The same in colour; rgb: # 3 * width_px * height_px, with more rows below the picture where
    // it is longer. grey: as in add(), for the sheet.
    Status add_colour(int frame,
                      std::span<const std::uint8_t> grey,
                      std::span<const std::uint8_t> rgb,
                      std::string_view caption = {});
    // Writes the sheet, and pictures.json: what another program needs to measure in the pictures.
    struct About {
        std::string case_name, exercise, program;
        double mm_per_px = 0, origin_x_px = 0, origin_y_px = 0, frames_per_s = 0;
    };
    Status finish(const About& about);

    // "4.5 S  -12 88 342 MM": time, and the middle of the probe's face in `mannequin`.
    static std::string caption(double time_s, const Rigid& mannequin_from_probe);

  private:
    explicit FrameFiles(std::string folder) : folder_(std::move(folder)) {}

    std::string folder_, copyright_;
    int width_px_ = 0, height_px_ = 0;
    std::unique_ptr<ContactSheet> sheet_;
};

}  // namespace sonocase::runtime
