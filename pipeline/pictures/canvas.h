// SPDX-License-Identifier: Apache-2.0

// A small drawing surface that produces an anti-aliased picture and the same drawing as SVG. It
// needs no display and gives the same bytes on every machine. Coordinates are pixels, origin at the
// lower left, y up, as in VTK's 2-D contexts.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace sonocase::pipeline {

struct CanvasPoint {
    double x = 0, y = 0;
};
using CanvasColour = std::array<std::uint8_t, 4>;  // sRGB and opacity

class Canvas {
  public:
    Canvas(int width, int height);
    int width() const { return width_; }
    int height() const { return height_; }

    void fill(std::span<const CanvasPoint> polygon, CanvasColour colour);
    // dash 0: solid; else length of dash and gap in pixels.
    void line(std::span<const CanvasPoint> points,
              double width,
              CanvasColour colour,
              double dash = 0);
    void disc(CanvasPoint centre, double radius, CanvasColour colour);
    // Text as an opacity mask, rows from the bottom up, with its lower left pixel at (x, y). In the
    // SVG it remains text: anchored at `at`, turned by `degrees`, anchor "start", "middle" or
    // "end".
    struct Text {
        std::string text;
        CanvasPoint at;
        double degrees = 0, size_px = 12;
        const char* anchor = "start";
        bool bold = false;
    };
    void text(std::span<const std::uint8_t> mask,
              int mask_width,
              int mask_height,
              int x,
              int y,
              CanvasColour colour,
              const Text& text);
    // Clips everything drawn later to the rectangle; without arguments, to the whole canvas.
    void clip(double x, double y, double width, double height);
    void clip();

    const std::vector<std::uint8_t>& rgb() const { return rgb_; }  // rows from the top down
    std::string svg() const;

  private:
    void blend(int x, int y, double coverage, CanvasColour colour);
    int width_, height_;
    double x0_, y0_, x1_, y1_;
    std::vector<std::uint8_t> rgb_;
    std::vector<double> row_;  // coverage of one row while filling
    std::string body_, definitions_;
    int clips_ = 0;
};

}  // namespace sonocase::pipeline
