// SPDX-License-Identifier: Apache-2.0

// The pictures of a session as a film: those of the moments that matter, which the player keeps
// beside the recording, or all of them where the player was asked to write them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline {

struct UltrasoundFilm {
    int width_px = 0, height_px = 0;
    int channels = 1;                  // 1: grey, 3: red, green, blue
    std::vector<std::uint8_t> pixels;  // # frames * height * width * channels
    std::vector<double> times_s;       // # frames, increasing
    double mm_per_px = 0;              // 0: not known, and the file says nothing about distances
    double origin_x_px = 0, origin_y_px = 0;  // middle of the probe's face
    int picture_height_px = 0;  // rows of the picture; those below it are a strip over time
    std::string case_name, exercise;
    std::string program;  // that made the pictures
    std::string started;  // ISO 8601, UTC; empty: not known

    std::size_t frame_bytes() const {
        return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px) *
               static_cast<std::size_t>(channels);
    }
};

// path   a recording (x.igs.mha, with x.frames.igs.mha beside it), a sequence that has pictures
//        itself, or a folder of `sonoplay --headless --out`, whose pictures.json gives scale and
//        times
// Errors: no pictures; pictures of several sizes; a file that cannot be read.
Result<UltrasoundFilm> film_of_session(const std::string& path);

}  // namespace sonocase::pipeline
