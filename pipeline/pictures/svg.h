// SPDX-License-Identifier: Apache-2.0

// Elements of an SVG picture, one per line. Coordinates are pixels with y down, as in SVG.
#pragma once

#include <string>
#include <string_view>

namespace sonocase::pipeline::inline pictures {

// At most two decimals, as they stand in attributes.
std::string svg_number(double value);

// The attribute `d` of a path.
class SvgPath {
  public:
    void move_to(double x, double y);
    void line_to(double x, double y);
    void close() { text_ += 'Z'; }
    const std::string& text() const { return text_; }

  private:
    std::string text_;
};

// `style` holds further attributes, such as class="grid" or fill="#ff0000". Texts and titles are
// escaped here; a title is what a browser shows when the pointer rests on the element.
class Svg {
  public:
    void line(double x0, double y0, double x1, double y1, std::string_view style);
    void path(const SvgPath& path, std::string_view style);
    void rectangle(double x, double y, double width, double height, std::string_view style);
    void circle(
        double x, double y, double radius, std::string_view style, std::string_view title = {});
    void text(double x, double y, std::string_view text, std::string_view style);
    void open_group(std::string_view style, std::string_view title = {});
    void close_group();
    // An element written by the caller.
    void element(std::string_view text);

    // The picture with the attributes of its root element. A file of its own also needs
    // xmlns="http://www.w3.org/2000/svg" among them; a picture inside a page does not.
    std::string picture(double width, double height, std::string_view attributes) const;

  private:
    std::string elements_;
};

}  // namespace sonocase::pipeline::inline pictures
