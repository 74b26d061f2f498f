// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart_legend.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::pipeline::inline pictures {
namespace {

constexpr double kPaddingPx = 6, kSymbolPx = 26, kWordsPx = 14, kLineGapPx = 3;
constexpr double kDescentPx = 3;  // from the bottom of the words to their base line

void draw_symbol(Canvas& canvas, const LegendItem& item, CanvasPoint corner, const LegendBox& box) {
    const double left = corner.x + box.left, right = left + box.width;
    const CanvasPoint middle{0.5 * (left + right), corner.y + box.bottom + 0.5 * box.height};
    const std::array<CanvasPoint, 2> line{{{left, middle.y}, {right, middle.y}}};
    const double max_radius = 0.5 * box.height;
    switch (item.style) {
        case SeriesStyle::bars: {
            const double half = std::min(5.0, max_radius);
            const std::array<CanvasPoint, 4> bar{{{left, middle.y - half},
                                                  {right, middle.y - half},
                                                  {right, middle.y + half},
                                                  {left, middle.y + half}}};
            canvas.fill(bar, item.colour);
            break;
        }
        case SeriesStyle::line:
        case SeriesStyle::dashed:
            canvas.line(line, item.width_px, item.colour,
                        item.style == SeriesStyle::dashed ? 6 : 0);
            break;
        case SeriesStyle::line_and_points:
            canvas.line(line, item.width_px, item.colour);
            draw_mark(canvas, item, middle, std::min(3.5, max_radius));
            break;
        case SeriesStyle::points:
        case SeriesStyle::crosses:
        case SeriesStyle::diamonds:
            draw_mark(canvas, item, middle, std::min(1.5 * item.width_px, max_radius));
            break;
    }
}

}  // namespace

Legend lay_out_legend(std::span<const LegendItem> items, double max_width_px) {
    Legend legend;
    if (items.empty()) return legend;
    const double beside_words = 3 * kPaddingPx + kSymbolPx;
    const double max_words = std::max(80.0, max_width_px) - beside_words;
    const double line = kWordsPx + kLineGapPx;
    legend.height = line * static_cast<double>(items.size()) - kLineGapPx + 2 * kPaddingPx;
    double widest = 0;
    for (std::size_t k = 0; k < items.size(); ++k) {
        LegendEntry entry{items[k], {}, {}};
        entry.item.name = shortened(items[k].name, {}, max_words);
        const double bottom = legend.height - kPaddingPx - kWordsPx - line * static_cast<double>(k);
        entry.symbol = {kPaddingPx, bottom, kSymbolPx, kWordsPx};
        entry.words = {2 * kPaddingPx + kSymbolPx, bottom, text_width_px(entry.item.name, {}),
                       kWordsPx};
        widest = std::max(widest, entry.words.width);
        legend.entries.push_back(std::move(entry));
    }
    legend.width = std::ceil(beside_words + widest);
    return legend;
}

void draw_legend(Canvas& canvas, const Legend& legend, CanvasPoint corner) {
    if (legend.entries.empty()) return;
    const CanvasPoint far{corner.x + legend.width, corner.y + legend.height};
    const std::array<CanvasPoint, 5> frame{
        {corner, {far.x, corner.y}, far, {corner.x, far.y}, corner}};
    canvas.fill(frame, {255, 255, 255, 255});
    canvas.line(frame, 1, {200, 200, 200, 255});
    for (const LegendEntry& entry : legend.entries) {
        draw_symbol(canvas, entry.item, corner, entry.symbol);
        canvas.text(entry.item.name,
                    {corner.x + entry.words.left, corner.y + entry.words.bottom + kDescentPx}, {});
    }
}

void draw_mark(Canvas& canvas, const LegendItem& item, CanvasPoint centre, double radius_px) {
    const CanvasPoint c = centre;
    const double r = radius_px;
    if (item.style == SeriesStyle::crosses) {
        const std::array<CanvasPoint, 2> rising{{{c.x - r, c.y - r}, {c.x + r, c.y + r}}};
        const std::array<CanvasPoint, 2> falling{{{c.x - r, c.y + r}, {c.x + r, c.y - r}}};
        canvas.line(rising, 1.6, item.colour);
        canvas.line(falling, 1.6, item.colour);
    } else if (item.style == SeriesStyle::diamonds) {
        const std::array<CanvasPoint, 4> rhomb{
            {{c.x - r, c.y}, {c.x, c.y - r}, {c.x + r, c.y}, {c.x, c.y + r}}};
        canvas.fill(rhomb, item.colour);
    } else {
        canvas.disc(c, r, item.colour);
    }
}

}  // namespace sonocase::pipeline::inline pictures
