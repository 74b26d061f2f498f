// SPDX-License-Identifier: Apache-2.0

// The ultrasound picture as on a machine: depth scale, focus mark, orientation mark, grey bar,
// distance measurements, and the text in its corners.
#pragma once

#include <string>
#include <vector>

#include "runtime/player/app/measurements.h"
#include "runtime/player/app/scan_frame.h"

namespace sonocase::runtime {

struct ImageViewInput {
    const ScanFrame& frame;
    void* texture;  // of the frame's pixels; null: none yet
    const Probe& probe;
    const Measurements& measurements;
    std::vector<std::string> left_lines, right_lines;  // corner texts
    bool flipped = false;
    bool measuring = false;
    float scale = 1;
};

// Where the picture is on the screen, to turn a place on one into a place on the other.
struct ImagePlace {
    float x = 0, y = 0, side_x = 0, side_y = 0;  // screen pixels
    double mm_per_screen_px = 1;
    double origin_x = 0, origin_y = 0;  // screen pixel of the middle of the probe's face
    bool hovered = false;               // the mouse is over the picture, or dragging from it
};

// Draws into the current ImGui window; width and height in screen pixels.
ImagePlace draw_image_view(float width, float height, const ImageViewInput& input);

}  // namespace sonocase::runtime
