// SPDX-License-Identifier: Apache-2.0

// The pictures of a session as a film, and a film as DICOM. The pictures are those of the moments
// that matter, which the player keeps beside the recording, or all of them where the player was
// asked to write them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline exporting {

struct UltrasoundFilm {
    int width_px = 0, height_px = 0;
    int channels = 1;                  // 1: grey, 3: red, green, blue
    std::vector<std::uint8_t> pixels;  // # frames * height * width * channels
    std::vector<double> times_s;       // # frames, increasing
    double mm_per_px = 0;              // 0: not known, and the file says nothing about distances
    double origin_x_px = 0, origin_y_px = 0;  // middle of the probe's face
    int picture_height_px = 0;  // rows of the picture; those below it are a strip over time
    std::string case_name, exercise;
    std::string program;  // the one that made the pictures
    std::string started;  // ISO 8601, UTC; empty: not known

    std::size_t frame_bytes() const {
        return static_cast<std::size_t>(width_px) * height_px * channels;
    }
};

// Reads the pictures of a recording (x.igs.mha, with x.frames.igs.mha beside it), of a sequence
// that has pictures itself, or of a folder of `sonoplay --headless --out`, whose pictures.json
// gives scale and times. Errors: no pictures; pictures of several sizes; a file that cannot be
// read.
Result<UltrasoundFilm> film_of_session(const std::string& path);

// Writes a film as Ultrasound Multi-frame Image Storage (PS3.3 A.7), uncompressed, with the region
// calibration (C.8.5.5) that lets a viewer measure in it. There is no patient: the patient's name
// is that of the case.
//
// The same film gives the same bytes: identifiers are made from a hash of the pictures (2.25, PS3.5
// B.2), and dates are those of the session. Errors: the file cannot be written; more than 65535
// pixels on a side.
Status write_ultrasound_dicom(const UltrasoundFilm& film, const std::string& path);

// "2.25." followed by the decimal form of 32 hex digits; at most 64 characters.
std::string uid_from_hex(const std::string& hex);

}  // namespace sonocase::pipeline::inline exporting
