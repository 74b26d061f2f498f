// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart_legend.h"

#include <vtkNew.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/pictures/chart_text.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPaddingPx = 6, kSymbolPx = 26, kLineGapPx = 5;

void set_style(vtkTextProperty& style) {
    style.SetFontSize(12);
    style.SetColor(0, 0, 0);
    style.SetJustificationToLeft();
    style.SetVerticalJustificationToBottom();
}

// The name, or as much of it as fits, followed by an ellipsis. Cuts between UTF-8 characters.
std::string shortened(vtkTextProperty& style, const std::string& name, double most_px) {
    if (text_box(style, name).width <= most_px) return name;
    std::string cut = name;
    while (!cut.empty() && text_box(style, cut + "...").width > most_px) {
        do cut.pop_back();
        while (!cut.empty() && (static_cast<unsigned char>(cut.back()) & 0xc0) == 0x80);
        if (!cut.empty() && static_cast<unsigned char>(cut.back()) >= 0xc0) cut.pop_back();
    }
    return cut + "...";
}

void draw_mark(Canvas& canvas, const LegendItem& item, CanvasPoint c, double radius) {
    const double r = radius;
    if (item.look == SeriesLook::crosses) {
        const std::array<CanvasPoint, 2> rising{{{c.x - r, c.y - r}, {c.x + r, c.y + r}}};
        const std::array<CanvasPoint, 2> falling{{{c.x - r, c.y + r}, {c.x + r, c.y - r}}};
        canvas.line(rising, 1.6, item.colour);
        canvas.line(falling, 1.6, item.colour);
    } else if (item.look == SeriesLook::diamonds) {
        const std::array<CanvasPoint, 4> rhomb{
            {{c.x - r, c.y}, {c.x, c.y - r}, {c.x + r, c.y}, {c.x, c.y + r}}};
        canvas.fill(rhomb, item.colour);
    } else {
        canvas.disc(c, r, item.colour);
    }
}

void draw_symbol(Canvas& canvas, const LegendItem& item, CanvasPoint corner, const LegendBox& box) {
    const double left = corner.x + box.left, right = left + box.width;
    const CanvasPoint middle{0.5 * (left + right), corner.y + box.bottom + 0.5 * box.height};
    const std::array<CanvasPoint, 2> line{{{left, middle.y}, {right, middle.y}}};
    const double most_radius = 0.5 * box.height;
    switch (item.look) {
        case SeriesLook::bars: {
            const double half = std::min(5.0, most_radius);
            const std::array<CanvasPoint, 4> bar{{{left, middle.y - half},
                                                  {right, middle.y - half},
                                                  {right, middle.y + half},
                                                  {left, middle.y + half}}};
            canvas.fill(bar, item.colour);
            break;
        }
        case SeriesLook::line:
        case SeriesLook::dashed:
            canvas.line(line, item.width_px, item.colour, item.look == SeriesLook::dashed ? 6 : 0);
            break;
        case SeriesLook::line_and_points:
            canvas.line(line, item.width_px, item.colour);
            draw_mark(canvas, item, middle, std::min(3.5, most_radius));
            break;
        case SeriesLook::points:
        case SeriesLook::crosses:
        case SeriesLook::diamonds:
            draw_mark(canvas, item, middle, std::min(1.5 * item.width_px, most_radius));
            break;
    }
}

}  // namespace

Legend lay_out_legend(std::span<const LegendItem> items, double most_width_px) {
    Legend legend;
    if (items.empty()) return legend;
    vtkNew<vtkTextProperty> style;
    set_style(*style);
    const double beside_words = 3 * kPaddingPx + kSymbolPx;
    const double most_words = std::max(80.0, most_width_px) - beside_words;
    const TextBox tall = text_box(*style, "Tgyf");
    const double line = tall.height + kLineGapPx;
    legend.height = line * static_cast<double>(items.size()) - kLineGapPx + 2 * kPaddingPx;
    double widest = 0;
    for (std::size_t k = 0; k < items.size(); ++k) {
        LegendEntry entry{items[k], {}, {}};
        entry.item.name = shortened(*style, items[k].name, most_words);
        const double bottom =
            legend.height - kPaddingPx - tall.height - line * static_cast<double>(k);
        entry.symbol = {kPaddingPx, bottom, kSymbolPx, static_cast<double>(tall.height)};
        const TextBox words = text_box(*style, entry.item.name);
        entry.words = {2 * kPaddingPx + kSymbolPx, bottom, static_cast<double>(words.width),
                       static_cast<double>(tall.height)};
        widest = std::max(widest, entry.words.width);
        legend.entries.push_back(std::move(entry));
    }
    legend.width = std::ceil(beside_words + widest);
    return legend;
}

void draw_legend(Canvas& canvas, const Legend& legend, CanvasPoint corner) {
    if (legend.entries.empty()) return;
    const CanvasPoint far{corner.x + legend.width, corner.y + legend.height};
    const std::array<CanvasPoint, 4> frame{{corner, {far.x, corner.y}, far, {corner.x, far.y}}};
    canvas.fill(frame, {255, 255, 255, 255});
    const std::array<CanvasPoint, 5> outline{{corner, frame[1], far, frame[3], corner}};
    canvas.line(outline, 1, {200, 200, 200, 255});
    vtkNew<vtkTextProperty> style;
    set_style(*style);
    for (const LegendEntry& entry : legend.entries) {
        draw_symbol(canvas, entry.item, corner, entry.symbol);
        draw_text(canvas, *style, entry.item.name,
                  {corner.x + entry.words.left, corner.y + entry.words.bottom});
    }
}

}  // namespace sonocase::pipeline
