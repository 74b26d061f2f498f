// SPDX-License-Identifier: Apache-2.0

// A small drawing surface that produces an anti-aliased picture and the same drawing as SVG. It
// needs no display and gives the same bytes on every machine. Coordinates are pixels with the
// origin at the lower left and y up.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/pictures/svg.h"

namespace sonocase::pipeline::inline pictures {

struct CanvasPoint {
    double x = 0, y = 0;
};
using CanvasColour = std::array<std::uint8_t, 4>;  // sRGB and opacity

enum class TextAnchor { start, middle, end };

struct TextStyle {
    int size_px = 12;
    bool bold = false;
    CanvasColour colour{0, 0, 0, 255};
    TextAnchor anchor = TextAnchor::start;
    bool upright = false;  // turned by 90 degrees: reads from the bottom up
};

// The length of a line of text. FreeType (through VTK) measures it and draws it.
double text_width_px(const std::string& text, const TextStyle& style);

// The text, or as much of it as fits, followed by an ellipsis. Cuts between UTF-8 characters.
std::string shortened(const std::string& text, const TextStyle& style, double max_px);

class Canvas {
  public:
    Canvas(int width, int height);
    int width() const { return width_; }
    int height() const { return height_; }

    void fill(std::span<const CanvasPoint> polygon, CanvasColour colour);
    // dash_px 0: solid; otherwise the length of each dash and of each gap.
    void line(std::span<const CanvasPoint> points,
              double width_px,
              CanvasColour colour,
              double dash_px = 0);
    void disc(CanvasPoint centre, double radius_px, CanvasColour colour);
    // One line of text; its base line begins, has its middle or ends at `at`.
    void text(const std::string& text, CanvasPoint at, const TextStyle& style);
    // A grey picture, # width * height, rows from the top down; each of its pixels covers
    // factor * factor pixels of the canvas. `corner` is its lower left corner.
    void grey_picture(std::span<const std::uint8_t> pixels,
                      int width,
                      int height,
                      int factor,
                      CanvasPoint corner);
    // Clips everything drawn later to the rectangle; without arguments, to the whole canvas.
    void clip(double x, double y, double width, double height);
    void clip();

    const std::vector<std::uint8_t>& rgb() const { return rgb_; }  // rows from the top down
    std::string svg() const;  // a file of its own; its background is white

  private:
    bool clipped() const { return x0_ > 0 || y0_ > 0 || x1_ < width_ || y1_ < height_; }
    void blend(int x, int y, double coverage, CanvasColour colour);
    void paint(std::span<const CanvasPoint> polygon, CanvasColour colour);
    void paint_disc(CanvasPoint centre, double radius_px, CanvasColour colour);

    int width_, height_;
    double x0_, y0_, x1_, y1_;  // the rectangle that is drawn on
    std::vector<std::uint8_t> rgb_;
    std::vector<double> row_;  // coverage of one row while filling
    Svg svg_;
    int clips_ = 0;
};

}  // namespace sonocase::pipeline::inline pictures
