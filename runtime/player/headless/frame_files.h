// SPDX-License-Identifier: Apache-2.0

// The frames of a run as pictures: one file each, and one sheet of the whole run.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::runtime::inline player_headless {

// One picture of a whole run: up to twelve frames, evenly spread over it, at a quarter of their
// area, each with its time and the place of the probe.
class ContactSheet {
  public:
    // The sheet of a run of `frames` frames of width x height pixels; frames >= 1, width and
    // height >= 2.
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

// The frames of a run as files of one folder: frame_00000.png and so on, and contact-sheet.png.

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

}  // namespace sonocase::runtime::inline player_headless
