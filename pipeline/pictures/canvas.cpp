// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/canvas.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pipeline/pictures/markup.h"

namespace sonocase::pipeline {
namespace {

std::string number(double v) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f", v);
    return text;
}

std::string colour_text(const char* what, CanvasColour c) {
    char text[96];
    std::snprintf(text, sizeof text, " %s=\"#%02x%02x%02x\"", what, c[0], c[1], c[2]);
    std::string out = text;
    if (c[3] < 255) out += std::string(" ") + what + "-opacity=\"" + number(c[3] / 255.0) + "\"";
    return out;
}

}  // namespace

Canvas::Canvas(int width, int height)
    : width_(width),
      height_(height),
      x0_(0),
      y0_(0),
      x1_(width),
      y1_(height),
      rgb_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3, 255),
      row_(static_cast<std::size_t>(width) + 1) {}

void Canvas::blend(int x, int y, double coverage, CanvasColour c) {
    const double a = std::min(coverage, 1.0) * c[3] / 255.0;
    std::uint8_t* p =
        &rgb_[3 * (static_cast<std::size_t>(height_ - 1 - y) * static_cast<std::size_t>(width_) +
                   static_cast<std::size_t>(x))];
    for (std::size_t k = 0; k < 3; ++k)
        p[k] = static_cast<std::uint8_t>(std::lround((1 - a) * p[k] + a * c[k]));
}

void Canvas::fill(std::span<const CanvasPoint> polygon, CanvasColour colour) {
    if (polygon.size() < 3 || colour[3] == 0) return;
    body_ += "<polygon points=\"";
    double low = INFINITY, high = -INFINITY;
    for (const CanvasPoint& p : polygon) {
        body_ += number(p.x) + "," + number(height_ - p.y) + " ";
        low = std::min(low, p.y);
        high = std::max(high, p.y);
    }
    body_ += "\"" + colour_text("fill", colour) + "/>\n";

    // Even-odd rule, four lines per row, exact coverage along each line.
    constexpr int kLines = 4;
    const int first = std::max(0, static_cast<int>(std::floor(std::max(low, y0_))));
    const int last = std::min(height_ - 1, static_cast<int>(std::floor(std::min(high, y1_))));
    std::vector<double> crossings;
    for (int y = first; y <= last; ++y) {
        int left = width_, right = -1;
        for (int line = 0; line < kLines; ++line) {
            const double at = y + (line + 0.5) / kLines;
            if (at < y0_ || at > y1_) continue;
            crossings.clear();
            for (std::size_t i = 0; i < polygon.size(); ++i) {
                const CanvasPoint &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
                if ((a.y <= at) == (b.y <= at)) continue;
                crossings.push_back(a.x + (at - a.y) / (b.y - a.y) * (b.x - a.x));
            }
            std::sort(crossings.begin(), crossings.end());
            for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) {
                const double from = std::clamp(crossings[k], x0_, x1_),
                             to = std::clamp(crossings[k + 1], x0_, x1_);
                if (!(to > from)) continue;
                const int a = static_cast<int>(from),
                          b = std::min(width_ - 1, static_cast<int>(to));
                for (int x = a; x <= b; ++x) {
                    const double part =
                        std::min(to, x + 1.0) - std::max(from, static_cast<double>(x));
                    if (part > 0) row_[static_cast<std::size_t>(x)] += part / kLines;
                }
                left = std::min(left, a);
                right = std::max(right, b);
            }
        }
        for (int x = left; x <= right; ++x) {
            double& c = row_[static_cast<std::size_t>(x)];
            if (c > 0) blend(x, y, c, colour);
            c = 0;
        }
    }
}

void Canvas::line(std::span<const CanvasPoint> points,
                  double width,
                  CanvasColour colour,
                  double dash) {
    if (points.size() < 2 || colour[3] == 0) return;
    const std::string body = body_;
    const double half = std::max(0.5, 0.5 * width);
    // Each dash is a box; joints of a solid line are covered by discs.
    double along = 0;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const CanvasPoint a = points[i], b = points[i + 1];
        const double length = std::hypot(b.x - a.x, b.y - a.y);
        if (!(length > 0) || !std::isfinite(length)) continue;
        const double ux = (b.x - a.x) / length, uy = (b.y - a.y) / length;
        double from = 0;
        while (from < length) {
            double to = length;
            bool on = true;
            if (dash > 0) {
                const double phase = std::fmod(along + from, 2 * dash);
                on = phase < dash;
                to = std::min(length, from + (on ? dash - phase : 2 * dash - phase) + 1e-6);
            }
            if (on) {
                const double nx = -uy * half, ny = ux * half;
                const CanvasPoint s{a.x + from * ux, a.y + from * uy},
                    e{a.x + to * ux, a.y + to * uy};
                const std::array<CanvasPoint, 4> box{{{s.x + nx, s.y + ny},
                                                      {e.x + nx, e.y + ny},
                                                      {e.x - nx, e.y - ny},
                                                      {s.x - nx, s.y - ny}}};
                fill(box, colour);
            }
            from = to;
        }
        along += length;
        if (dash <= 0 && half > 0.7 && i > 0 && colour[3] == 255) disc(a, half, colour);
    }
    // In the SVG one element replaces the boxes.
    body_ = body + "<polyline points=\"";
    for (const CanvasPoint& p : points) body_ += number(p.x) + "," + number(height_ - p.y) + " ";
    body_ += "\" fill=\"none\"" + colour_text("stroke", colour) + " stroke-width=\"" +
             number(2 * half) + "\"";
    if (dash > 0) body_ += " stroke-dasharray=\"" + number(dash) + "\"";
    body_ += "/>\n";
}

void Canvas::disc(CanvasPoint c, double radius, CanvasColour colour) {
    if (!std::isfinite(c.x) || !std::isfinite(c.y)) return;
    const std::string body = body_;
    std::vector<CanvasPoint> circle;
    const int count = std::clamp(static_cast<int>(4 * radius), 8, 64);
    for (int k = 0; k < count; ++k) {
        const double a = 2 * 3.14159265358979323846 * k / count;
        circle.push_back({c.x + radius * std::cos(a), c.y + radius * std::sin(a)});
    }
    fill(circle, colour);
    body_ = body + "<circle cx=\"" + number(c.x) + "\" cy=\"" + number(height_ - c.y) + "\" r=\"" +
            number(radius) + "\"" + colour_text("fill", colour) + "/>\n";
}

void Canvas::text(std::span<const std::uint8_t> mask,
                  int mask_width,
                  int mask_height,
                  int x,
                  int y,
                  CanvasColour colour,
                  const Text& t) {
    for (int j = 0; j < mask_height; ++j) {
        for (int i = 0; i < mask_width; ++i) {
            const int px = x + i, py = y + j;
            if (px < x0_ || py < y0_ || px >= x1_ || py >= y1_) continue;
            const auto m = mask[static_cast<std::size_t>(j) * static_cast<std::size_t>(mask_width) +
                                static_cast<std::size_t>(i)];
            if (m > 0) blend(px, py, m / 255.0, colour);
        }
    }
    body_ += "<text x=\"" + number(t.at.x) + "\" y=\"" + number(height_ - t.at.y) +
             "\" font-size=\"" + number(t.size_px) + "\" text-anchor=\"" + t.anchor + "\"" +
             (t.bold ? " font-weight=\"bold\"" : "") + colour_text("fill", colour);
    if (t.degrees != 0) {
        body_ += " transform=\"rotate(" + number(-t.degrees) + " " + number(t.at.x) + " " +
                 number(height_ - t.at.y) + ")\"";
    }
    body_ += ">" + escaped_html(t.text) + "</text>\n";
}

void Canvas::clip(double x, double y, double w, double h) {
    clip();
    x0_ = std::clamp(x, 0.0, static_cast<double>(width_));
    y0_ = std::clamp(y, 0.0, static_cast<double>(height_));
    x1_ = std::clamp(x + w, 0.0, static_cast<double>(width_));
    y1_ = std::clamp(y + h, 0.0, static_cast<double>(height_));
    const std::string name = "clip" + std::to_string(++clips_);
    definitions_ += "<clipPath id=\"" + name + "\"><rect x=\"" + number(x0_) + "\" y=\"" +
                    number(height_ - y1_) + "\" width=\"" + number(x1_ - x0_) + "\" height=\"" +
                    number(y1_ - y0_) + "\"/></clipPath>\n";
    body_ += "<g clip-path=\"url(#" + name + ")\">\n";
}

void Canvas::clip() {
    const bool open = x0_ > 0 || y0_ > 0 || x1_ < width_ || y1_ < height_;
    if (open) body_ += "</g>\n";
    x0_ = y0_ = 0;
    x1_ = width_;
    y1_ = height_;
}

std::string Canvas::svg() const {
    const bool open = x0_ > 0 || y0_ > 0 || x1_ < width_ || y1_ < height_;
    const std::string w = std::to_string(width_), h = std::to_string(height_);
    return "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + w + "\" height=\"" + h +
           "\" viewBox=\"0 0 " + w + " " + h +
           "\" font-family=\"Arial, Helvetica, sans-serif\">\n<defs>\n" + definitions_ +
           "</defs>\n<rect width=\"" + w + "\" height=\"" + h + "\" fill=\"#ffffff\"/>\n" + body_ +
           (open ? "</g>\n" : "") + "</svg>\n";
}

}  // namespace sonocase::pipeline
