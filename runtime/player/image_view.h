// SPDX-License-Identifier: Apache-2.0

// The ultrasound picture as on a machine: depth scale, focus mark, orientation mark, grey bar,
// distance measurement, and the words in its corners.
#pragma once

#include <string>
#include <vector>

#include "runtime/player/scan_thread.h"

namespace sonocase::runtime {

struct Measurement {
    double x0_mm = 0, z0_mm = 0, x1_mm = 0, z1_mm = 0;  // probe frame
    double length_mm() const;
};

struct ImageViewInput {
    const ScanFrame* frame = nullptr;
    void* texture = nullptr;
    const Probe* probe = nullptr;
    std::vector<std::string> left_lines, right_lines;  // corner texts
    bool flipped = false;
    bool measuring = false;
    float scale = 1;
};

// Where the picture lies on the screen, for turning places of one into the other.
struct ImagePlace {
    float x = 0, y = 0, side_x = 0, side_y = 0;  // screen pixels
    double mm_per_screen_px = 1;
    double origin_x = 0, origin_y = 0;  // screen pixel of the probe face's middle
};

class ImageView {
  public:
    // Draws into the current ImGui window; width and height in screen pixels. The area takes the
    // mouse: hovered() and active() tell whether the picture has it.
    void draw(float width, float height, const ImageViewInput& input);
    bool hovered() const { return hovered_; }
    const ImagePlace& place() const { return place_; }

    // Distance tool: the first click sets a point, the second ends a measurement; two are kept.
    void click(double x_mm, double z_mm);
    void clear_measurements();
    const std::vector<Measurement>& measurements() const { return done_; }
    bool half_done() const { return half_; }

  private:
    void draw_scales(const ImageViewInput& input);
    void draw_measurements(const ImageViewInput& input);

    ImagePlace place_;
    bool hovered_ = false;
    std::vector<Measurement> done_;
    Measurement open_;
    bool half_ = false;
};

}  // namespace sonocase::runtime
