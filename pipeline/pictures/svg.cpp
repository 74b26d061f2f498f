// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/svg.h"

#include <cmath>

#include "formats/text/number_text.h"
#include "pipeline/pictures/markup.h"

namespace sonocase::pipeline::inline pictures {
namespace {

std::string attribute(std::string_view name, double value) {
    return " " + std::string(name) + "=\"" + svg_number(value) + "\"";
}

std::string styled(std::string_view style) {
    return style.empty() ? "" : " " + std::string(style);
}

}  // namespace

std::string svg_number(double value) {
    const double rounded = std::round(value * 100) / 100;
    return rounded == 0 ? "0" : number_text(rounded, 9);  // never "-0"
}

void SvgPath::move_to(double x, double y) {
    text_ += "M" + svg_number(x) + " " + svg_number(y);
}

void SvgPath::line_to(double x, double y) {
    text_ += "L" + svg_number(x) + " " + svg_number(y);
}

void Svg::line(double x0, double y0, double x1, double y1, std::string_view style) {
    elements_ += "<line" + attribute("x1", x0) + attribute("y1", y0) + attribute("x2", x1) +
                 attribute("y2", y1) + styled(style) + "/>\n";
}

void Svg::path(const SvgPath& path, std::string_view style) {
    elements_ += "<path d=\"" + path.text() + "\"" + styled(style) + "/>\n";
}

void Svg::rectangle(double x, double y, double width, double height, std::string_view style) {
    elements_ += "<rect" + attribute("x", x) + attribute("y", y) + attribute("width", width) +
                 attribute("height", height) + styled(style) + "/>\n";
}

void Svg::circle(
    double x, double y, double radius, std::string_view style, std::string_view title) {
    elements_ += "<circle" + attribute("cx", x) + attribute("cy", y) + attribute("r", radius) +
                 styled(style);
    elements_ += title.empty() ? "/>\n" : "><title>" + escaped_html(title) + "</title></circle>\n";
}

void Svg::text(double x, double y, std::string_view text, std::string_view style) {
    elements_ += "<text" + attribute("x", x) + attribute("y", y) + styled(style) + ">" +
                 escaped_html(text) + "</text>\n";
}

void Svg::open_group(std::string_view style, std::string_view title) {
    elements_ += "<g" + styled(style) + ">";
    if (!title.empty()) elements_ += "<title>" + escaped_html(title) + "</title>";
    elements_ += "\n";
}

void Svg::close_group() {
    elements_ += "</g>\n";
}

void Svg::element(std::string_view text) {
    elements_ += std::string(text) + "\n";
}

std::string Svg::picture(double width, double height, std::string_view attributes) const {
    return "<svg viewBox=\"0 0 " + svg_number(width) + " " + svg_number(height) + "\"" +
           styled(attributes) + ">\n" + elements_ + "</svg>\n";
}

}  // namespace sonocase::pipeline::inline pictures
