// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/canvas.h"

#include <vtkAutoInit.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkStdString.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/base/base64.h"
#include "formats/base/constants.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/pictures/png.h"

// VTK finds its text renderer through an object factory.
VTK_MODULE_INIT(vtkRenderingFreeType)

namespace sonocase::pipeline::inline pictures {
namespace {

constexpr int kDpi = 72;  // one point of a font is one pixel

// fill="#rrggbb", with its opacity where it is not solid.
std::string colour_style(const std::string& what, CanvasColour c) {
    char text[16];
    std::snprintf(text, sizeof text, "#%02x%02x%02x", c[0], c[1], c[2]);
    std::string style = what + "=\"" + text + "\"";
    if (c[3] < 255) style += " " + what + "-opacity=\"" + svg_number(c[3] / 255.0) + "\"";
    return style;
}

void set_font(const TextStyle& style, vtkTextProperty& font) {
    font.SetFontFamilyToArial();
    font.SetFontSize(style.size_px);
    font.SetBold(style.bold);
    font.SetColor(1, 1, 1);
    font.SetJustificationToLeft();
    font.SetVerticalJustificationToBottom();
}

// How opaque a line of text is, row by row from the bottom up.
struct TextMask {
    int width_px = 0, height_px = 0;
    int below_px = 0;  // rows below the base line
    std::vector<std::uint8_t> opacity;
    std::uint8_t at(int x, int y) const { return opacity[x + width_px * y]; }
};

TextMask text_mask(const std::string& text, const TextStyle& style) {
    TextMask mask;
    vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
    vtkNew<vtkTextProperty> font;
    set_font(style, *font);
    vtkNew<vtkImageData> image;
    vtkTextRenderer::Metrics metrics;
    int used[2] = {0, 0};
    if (text.empty() || !renderer ||
        !renderer->RenderString(font, vtkStdString(text), image, used, kDpi) ||
        !renderer->GetMetrics(font, vtkStdString(text), metrics, kDpi))
        return mask;
    mask.width_px = used[0];
    mask.height_px = used[1];
    mask.below_px = 1 - metrics.Descent[1];
    for (int j = 0; j < used[1]; ++j)
        for (int i = 0; i < used[0]; ++i)
            mask.opacity.push_back(
                static_cast<std::uint8_t>(image->GetScalarComponentAsDouble(i, j, 0, 3)));
    return mask;
}

}  // namespace

double text_width_px(const std::string& text, const TextStyle& style) {
    vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
    vtkNew<vtkTextProperty> font;
    set_font(style, *font);
    int box[4] = {0, -1, 0, -1};
    if (text.empty() || !renderer || !renderer->GetBoundingBox(font, vtkStdString(text), box, kDpi))
        return 0;
    return box[1] - box[0] + 1;
}

std::string shortened(const std::string& text, const TextStyle& style, double max_px) {
    if (text_width_px(text, style) <= max_px) return text;
    std::string cut = text;
    while (!cut.empty() && text_width_px(cut + "...", style) > max_px) {
        do cut.pop_back();
        while (!cut.empty() && (static_cast<unsigned char>(cut.back()) & 0xc0) == 0x80);
        if (!cut.empty() && static_cast<unsigned char>(cut.back()) >= 0xc0) cut.pop_back();
    }
    return cut + "...";
}

Canvas::Canvas(int width, int height)
    : width_(width),
      height_(height),
      x0_(0),
      y0_(0),
      x1_(width),
      y1_(height),
      rgb_(static_cast<std::size_t>(3) * width * height, 255),
      row_(static_cast<std::size_t>(width) + 1) {
    svg_.rectangle(0, 0, width, height, "fill=\"#ffffff\"");
}

void Canvas::blend(int x, int y, double coverage, CanvasColour c) {
    const double a = std::min(coverage, 1.0) * c[3] / 255.0;
    std::uint8_t* p = &rgb_[3 * (static_cast<std::size_t>(height_ - 1 - y) * width_ + x)];
    for (std::size_t k = 0; k < 3; ++k)
        p[k] = static_cast<std::uint8_t>(std::lround((1 - a) * p[k] + a * c[k]));
}

// Even-odd rule, four lines per row, exact coverage along each line.
void Canvas::paint(std::span<const CanvasPoint> polygon, CanvasColour colour) {
    double low = INFINITY, high = -INFINITY;
    for (const CanvasPoint& p : polygon) {
        low = std::min(low, p.y);
        high = std::max(high, p.y);
    }
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
                    if (part > 0) row_[x] += part / kLines;
                }
                left = std::min(left, a);
                right = std::max(right, b);
            }
        }
        for (int x = left; x <= right; ++x) {
            double& c = row_[x];
            if (c > 0) blend(x, y, c, colour);
            c = 0;
        }
    }
}

void Canvas::fill(std::span<const CanvasPoint> polygon, CanvasColour colour) {
    if (polygon.size() < 3 || colour[3] == 0) return;
    paint(polygon, colour);
    SvgPath path;
    path.move_to(polygon[0].x, height_ - polygon[0].y);
    for (const CanvasPoint& p : polygon.subspan(1)) path.line_to(p.x, height_ - p.y);
    path.close();
    svg_.path(path, colour_style("fill", colour) + " fill-rule=\"evenodd\"");
}

void Canvas::line(std::span<const CanvasPoint> points,
                  double width_px,
                  CanvasColour colour,
                  double dash_px) {
    if (points.size() < 2 || colour[3] == 0) return;
    const double half = std::max(0.5, 0.5 * width_px);
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
            if (dash_px > 0) {
                const double phase = std::fmod(along + from, 2 * dash_px);
                on = phase < dash_px;
                to = std::min(length, from + (on ? dash_px - phase : 2 * dash_px - phase) + 1e-6);
            }
            if (on) {
                const double nx = -uy * half, ny = ux * half;
                const CanvasPoint s{a.x + from * ux, a.y + from * uy},
                    e{a.x + to * ux, a.y + to * uy};
                paint(std::array<CanvasPoint, 4>{{{s.x + nx, s.y + ny},
                                                  {e.x + nx, e.y + ny},
                                                  {e.x - nx, e.y - ny},
                                                  {s.x - nx, s.y - ny}}},
                      colour);
            }
            from = to;
        }
        along += length;
        if (dash_px <= 0 && half > 0.7 && i > 0 && colour[3] == 255) paint_disc(a, half, colour);
    }
    SvgPath path;
    path.move_to(points[0].x, height_ - points[0].y);
    for (const CanvasPoint& p : points.subspan(1)) path.line_to(p.x, height_ - p.y);
    std::string style = "fill=\"none\" " + colour_style("stroke", colour) + " stroke-width=\"" +
                        svg_number(2 * half) + "\" stroke-linejoin=\"round\"";
    if (dash_px > 0) style += " stroke-dasharray=\"" + svg_number(dash_px) + "\"";
    svg_.path(path, style);
}

void Canvas::paint_disc(CanvasPoint centre, double radius_px, CanvasColour colour) {
    std::vector<CanvasPoint> circle;
    const int count = std::clamp(static_cast<int>(4 * radius_px), 8, 64);
    for (int k = 0; k < count; ++k) {
        const double angle = 2 * kPi * k / count;
        circle.push_back(
            {centre.x + radius_px * std::cos(angle), centre.y + radius_px * std::sin(angle)});
    }
    paint(circle, colour);
}

void Canvas::disc(CanvasPoint centre, double radius_px, CanvasColour colour) {
    if (!std::isfinite(centre.x) || !std::isfinite(centre.y)) return;
    paint_disc(centre, radius_px, colour);
    svg_.circle(centre.x, height_ - centre.y, radius_px, colour_style("fill", colour));
}

void Canvas::text(const std::string& text, CanvasPoint at, const TextStyle& style) {
    const TextMask mask = text_mask(text, style);
    if (mask.opacity.empty()) return;
    const double share = style.anchor == TextAnchor::start    ? 0
                         : style.anchor == TextAnchor::middle ? 0.5
                                                              : 1;
    const double before = share * mask.width_px;
    const int x0 = static_cast<int>(std::lround(at.x - (style.upright ? 0 : before)));
    const int y0 = static_cast<int>(std::lround(at.y - (style.upright ? before : 0)));
    for (int j = 0; j < mask.height_px; ++j) {
        for (int i = 0; i < mask.width_px; ++i) {
            const int up = j - mask.below_px;
            const int x = style.upright ? x0 - 1 - up : x0 + i,
                      y = style.upright ? y0 + i : y0 + up;
            if (x < x0_ || y < y0_ || x >= x1_ || y >= y1_ || mask.at(i, j) == 0) continue;
            blend(x, y, mask.at(i, j) / 255.0, style.colour);
        }
    }
    // The reader's font may be wider than ours: the text keeps the length that was measured here.
    std::string attributes = "font-size=\"" + std::to_string(style.size_px) + "\" textLength=\"" +
                             std::to_string(mask.width_px) +
                             "\" lengthAdjust=\"spacingAndGlyphs\" ";
    if (style.anchor == TextAnchor::middle) attributes += "text-anchor=\"middle\" ";
    if (style.anchor == TextAnchor::end) attributes += "text-anchor=\"end\" ";
    if (style.bold) attributes += "font-weight=\"bold\" ";
    attributes += colour_style("fill", style.colour);
    if (style.upright)
        attributes += " transform=\"rotate(-90 " + svg_number(at.x) + " " +
                      svg_number(height_ - at.y) + ")\"";
    svg_.text(at.x, height_ - at.y, text, attributes);
}

void Canvas::grey_picture(
    std::span<const std::uint8_t> pixels, int width, int height, int factor, CanvasPoint corner) {
    const int left = static_cast<int>(std::lround(corner.x));
    const int bottom = static_cast<int>(std::lround(corner.y));
    for (int y = 0; y < factor * height; ++y) {
        for (int x = 0; x < factor * width; ++x) {
            const int px = left + x, py = bottom + y;
            if (px < x0_ || py < y0_ || px >= x1_ || py >= y1_) continue;
            const std::uint8_t grey = pixels[x / factor + width * (height - 1 - y / factor)];
            blend(px, py, 1, {grey, grey, grey, 255});
        }
    }
    svg_.element("<image x=\"" + std::to_string(left) + "\" y=\"" +
                 std::to_string(height_ - bottom - factor * height) + "\" width=\"" +
                 std::to_string(factor * width) + "\" height=\"" + std::to_string(factor * height) +
                 "\" style=\"image-rendering:pixelated\" href=\"data:image/png;base64," +
                 base64(png_from_grey(pixels.data(), width, height)) + "\"/>");
}

void Canvas::clip(double x, double y, double width, double height) {
    clip();
    x0_ = std::clamp(x, 0.0, static_cast<double>(width_));
    y0_ = std::clamp(y, 0.0, static_cast<double>(height_));
    x1_ = std::clamp(x + width, 0.0, static_cast<double>(width_));
    y1_ = std::clamp(y + height, 0.0, static_cast<double>(height_));
    if (!clipped()) return;
    const std::string name = "clip" + std::to_string(++clips_);
    svg_.element("<clipPath id=\"" + name + "\"><rect x=\"" + svg_number(x0_) + "\" y=\"" +
                 svg_number(height_ - y1_) + "\" width=\"" + svg_number(x1_ - x0_) +
                 "\" height=\"" + svg_number(y1_ - y0_) + "\"/></clipPath>");
    svg_.open_group("clip-path=\"url(#" + name + ")\"");
}

void Canvas::clip() {
    if (clipped()) svg_.close_group();
    x0_ = y0_ = 0;
    x1_ = width_;
    y1_ = height_;
}

std::string Canvas::svg() const {
    Svg svg = svg_;
    if (clipped()) svg.close_group();
    return svg.picture(width_, height_,
                       "xmlns=\"http://www.w3.org/2000/svg\" width=\"" + std::to_string(width_) +
                           "\" height=\"" + std::to_string(height_) +
                           "\" font-family=\"Arial, Helvetica, sans-serif\"");
}

}  // namespace sonocase::pipeline::inline pictures
