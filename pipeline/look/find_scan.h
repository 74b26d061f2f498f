// SPDX-License-Identifier: Apache-2.0

// Where the scan lies in the pixels: the fan or the rectangle that holds echoes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/image_scores/beam_image.h"
#include "pipeline/look/look_frames.h"

namespace sonocase::pipeline::inline look {

// Lengths in pixels. A fan's lines leave the apex at up to half_angle_rad from straight down.
struct FoundScan {
    bool fan = true;
    double apex_x_px = 0, apex_y_px = 0;  // linear: the middle of the face
    double radius_px = 0;                 // fan: of the face
    double half_angle_rad = 0;
    double width_px = 0;  // linear: of the face
    double depth_px = 0;
    double edge_share = 0;  // of the edge points that lie within 1.5 px of the sides found
    std::vector<std::string> warnings;
};

// Echoes are pixels that are brighter than the background or that move; `burnt` is left out. The
// sides are the two lines that most edge points lie on and almost none beyond; points at the
// picture's own border are not edges, so that a fan may be cut by it. Errors: pictures that are
// black, or without two straight sides.
Result<FoundScan> find_scan(const FramePile& pile, const std::vector<std::uint8_t>& burnt);

// The place of the scan in millimetres; mm_per_px > 0.
ScanPlace scan_place(const FoundScan& scan, double mm_per_px);

struct GivenScan {
    ScanPlace place;
    std::vector<std::size_t> use;  // frames that are to be measured; empty: all
};
// Reads {"kind": "fan", "mm_per_px", "apex_px": [x, y], "r_in_mm", "r_out_mm", "half_angle_deg"} or
// {"kind": "linear", "mm_per_px", "left_px", "right_px", "top_px", "bottom_px"}; "use": indices of
// frames. Other keys are ignored. Errors name `where` and the key.
Result<GivenScan> parse_scan(const std::string& json, const std::string& where);

}  // namespace sonocase::pipeline::inline look
