// SPDX-License-Identifier: Apache-2.0

// Videos of a camera as files: an AVI whose pictures are JPEG, as cameras write it; JPEG pictures
// one after another, as their stream is kept, or one alone; or a folder of JPEG files in the order
// of their names.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase {

struct JpegVideo {
    std::vector<std::vector<std::uint8_t>> pictures;  // empty: a picture that was dropped
    double rate_hz = 30;
};

// Errors: neither an AVI of MJPG nor a JPEG, no pictures. A last picture that is cut off stays so.
Result<JpegVideo> parse_jpeg_video(std::span<const std::uint8_t> bytes, const std::string& where);
// Errors: those of parse_jpeg_video and of reading files; a folder without .jpg or .jpeg files.
Result<JpegVideo> load_jpeg_video(const std::string& path);

}  // namespace sonocase
