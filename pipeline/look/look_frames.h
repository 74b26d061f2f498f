// SPDX-License-Identifier: Apache-2.0

// The frames that `sonocase look` measures: they are listed, read one by one, and combined per
// pixel to find what stands still.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline look {

struct LookFrame {
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> grey;    // # width * height, rows from the top down
    std::vector<std::uint8_t> colour;  // # the same; 1: strongly coloured, so not an echo
};

// Files as given; for a folder, its .png and .tif files in order of their names. Errors: a path
// that does not exist, or a folder without such files.
Result<std::vector<std::string>> list_frames(const std::vector<std::string>& inputs);

// Errors: see pipeline/texture/read_example.h.
Result<LookFrame> read_look_frame(const std::string& path);

// At most `count` indices below `total`, evenly spread, rising.
std::vector<std::size_t> spread_indices(std::size_t total, std::size_t count);

// Lowest, highest and mean grey per pixel over all frames.
struct FramePile {
    int frames = 0, width_px = 0, height_px = 0;
    std::vector<std::uint8_t> lowest, highest;  // per pixel, over frames
    std::vector<std::uint8_t> colour;           // 1: coloured in some frame
    std::vector<float> mean;                    // of the grey, per pixel

    // Error: a frame of another size.
    Status add(const LookFrame& frame, const std::string& path);
    std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * width_px + x; }
};

// Burnt-in graphics: coloured pixels, and bright ones that stay as they are while the picture moves
// (with 3 frames or more), each with a rim of two pixels. 1: burnt in.
std::vector<std::uint8_t> burnt_in(const FramePile& pile);

}  // namespace sonocase::pipeline::inline look
