// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/axis.h"
#include "pipeline/pictures/canvas.h"
#include "pipeline/pictures/chart_legend.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline pictures {
namespace {

// The set of Okabe and Ito without black: distinct for most colour-blind readers as well.
constexpr std::array<std::array<std::uint8_t, 3>, 7> kPalette{{{0, 114, 178},
                                                               {213, 94, 0},
                                                               {0, 158, 115},
                                                               {204, 121, 167},
                                                               {230, 159, 0},
                                                               {86, 180, 233},
                                                               {120, 120, 120}}};
constexpr CanvasColour kInk{25, 25, 25, 255}, kAxis{60, 60, 60, 255}, kGrid{225, 225, 225, 255},
    kFineGrid{240, 240, 240, 255};
constexpr double kGapPx = 8, kTickPx = 4, kLabelTextPx = 17, kTitleTextPx = 28;
constexpr double kLineMarkPx = 3.5;  // radius of the marks on a line

// The part of a canvas that a chart may use.
struct Area {
    double left = 0, bottom = 0, width = 0, height = 0;
};

// A chart's axes in place. Their pixels bound the plot.
struct Layout {
    Axis x, y;
    std::vector<Tick> x_ticks, y_ticks;
    double y_labels_px = 0;  // the widest tick label of the y axis
    double right() const { return x.from_px + x.length_px; }
    double top() const { return y.from_px + y.length_px; }
    CanvasPoint place(CanvasPoint p) const { return {x.place(p.x), y.place(p.y)}; }
};

// The pairs of a series that are shown.
std::vector<CanvasPoint> shown_points(const Chart& chart, const Series& s) {
    std::vector<CanvasPoint> shown;
    for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
        const double x = s.x[i], y = s.y[i];
        if (std::isfinite(x) && std::isfinite(y) && !(chart.x_log && x <= 0) &&
            !(chart.y_log && y <= 0))
            shown.push_back({x, y});
    }
    return shown;
}

// The least distance between bars along x; 1 for a single bar.
double bar_spacing(std::span<const CanvasPoint> bars) {
    double spacing = INFINITY;
    for (std::size_t i = 1; i < bars.size(); ++i) {
        const double d = std::abs(bars[i].x - bars[i - 1].x);
        if (d > 0) spacing = std::min(spacing, d);
    }
    return std::isfinite(spacing) ? spacing : 1;
}

void set_ranges(const Chart& chart, Layout& layout) {
    layout.x.log = chart.x_log;
    layout.y.log = chart.y_log;
    for (const Series& s : chart.series) {
        const std::vector<CanvasPoint> points = shown_points(chart, s);
        const bool bars = s.style == SeriesStyle::bars;
        if (bars && !chart.y_log) layout.y.range.include(0);
        const double half = bars && !chart.x_log ? 0.5 * bar_spacing(points) : 0;
        for (const CanvasPoint& p : points) {
            layout.x.range.include(p.x - half);
            layout.x.range.include(p.x + half);
            layout.y.range.include(p.y);
        }
    }
    pad(layout.x.range, chart.x_log);
    pad(layout.y.range, chart.y_log);
}

Layout lay_out(const Chart& chart, const Area& area) {
    Layout layout;
    set_ranges(chart, layout);
    const double below = kGapPx + kTickTextPx + (chart.x_label.empty() ? 0 : kLabelTextPx) + 4;
    const double above = chart.title.empty() ? kGapPx : kTitleTextPx;
    layout.y.from_px = area.bottom + below;
    layout.y.length_px = std::max(10.0, area.height - below - above);
    for (int pass = 0; pass < 2; ++pass) {  // equal axes change the labels, and labels the width
        layout.y_ticks = fitting_ticks(layout.y, true);
        layout.y_labels_px = 0;
        for (const Tick& t : layout.y_ticks)
            layout.y_labels_px = std::max(layout.y_labels_px, text_width_px(t.label, kTickStyle));
        const double before =
            2 * kGapPx + (chart.y_label.empty() ? 0 : kLabelTextPx) + layout.y_labels_px + kTickPx;
        layout.x.from_px = std::round(area.left + before);
        layout.x.length_px = std::max(10.0, area.left + area.width - 2 * kGapPx - layout.x.from_px);
        if (!chart.equal_axes) break;
        equalise(layout.x, layout.y);
    }
    layout.x_ticks = fitting_ticks(layout.x, false);
    return layout;
}

// Draws a title no longer than max_px: in smaller letters first, then shortened.
void draw_title(
    Canvas& canvas, const std::string& text, CanvasPoint at, TextStyle style, double max_px) {
    style.anchor = TextAnchor::middle;
    style.colour = kInk;
    while (style.size_px > 11 && text_width_px(text, style) > max_px) --style.size_px;
    canvas.text(shortened(text, style, max_px), at, style);
}

void draw_axes(const Chart& chart, const Layout& l, const Area& area, Canvas& canvas) {
    const auto line = [&](double x0, double y0, double x1, double y1, CanvasColour colour) {
        const std::array<CanvasPoint, 2> ends{{{x0, y0}, {x1, y1}}};
        canvas.line(ends, 1, colour);
    };
    const auto middle = [](double px) { return std::floor(px) + 0.5; };  // of a row of pixels
    const double left = middle(l.x.from_px), bottom = middle(l.y.from_px);
    for (const bool labelled : {false, true}) {  // the fine grid lies below
        const CanvasColour colour = labelled ? kGrid : kFineGrid;
        for (const Tick& t : l.x_ticks)
            if (!t.label.empty() == labelled)
                line(middle(l.x.place(t.value)), bottom, middle(l.x.place(t.value)), l.top(),
                     colour);
        for (const Tick& t : l.y_ticks)
            if (!t.label.empty() == labelled)
                line(left, middle(l.y.place(t.value)), l.right(), middle(l.y.place(t.value)),
                     colour);
    }
    line(left, bottom - 0.5, left, l.top(), kAxis);
    line(left - 0.5, bottom, l.right(), bottom, kAxis);
    TextStyle y_style = kTickStyle;
    y_style.anchor = TextAnchor::end;
    for (const Tick& t : l.x_ticks) {
        if (t.label.empty()) continue;
        line(middle(l.x.place(t.value)), bottom, middle(l.x.place(t.value)), bottom - kTickPx,
             kAxis);
        canvas.text(t.label, {l.x.place(t.value), bottom - kTickPx - kTickTextPx + 1}, kTickStyle);
    }
    for (const Tick& t : l.y_ticks) {
        if (t.label.empty()) continue;
        line(left, middle(l.y.place(t.value)), left - kTickPx, middle(l.y.place(t.value)), kAxis);
        canvas.text(t.label, {left - kTickPx - 3, l.y.place(t.value) - 4}, y_style);
    }
    draw_title(
        canvas, chart.x_label,
        {l.x.from_px + 0.5 * l.x.length_px, bottom - kGapPx - kTickTextPx - kLabelTextPx + 5},
        {.size_px = 14}, area.width - 2 * kGapPx);
    draw_title(canvas, chart.y_label, {area.left + kGapPx + 12, l.y.from_px + 0.5 * l.y.length_px},
               {.size_px = 14, .upright = true}, area.height - 2 * kGapPx);
}

CanvasColour colour_of(const Series& s, std::size_t number) {
    const bool own = s.colour != std::array<std::uint8_t, 3>{0, 0, 0};
    const auto c = own ? s.colour : kPalette[number % kPalette.size()];
    return {c[0], c[1], c[2], 255};
}

// From the bar's foot at zero to its end.
Area bar_area(const Layout& l, CanvasPoint p, double half_px) {
    const double foot = l.y.log ? l.y.from_px : l.y.place(0), end = l.y.place(p.y);
    return {l.x.place(p.x) - half_px, std::min(foot, end), 2 * half_px, std::abs(end - foot)};
}

double bar_half_px(const Layout& l, std::span<const CanvasPoint> points) {
    if (l.x.log || points.empty()) return 4;
    const double x = points[0].x, spacing = bar_spacing(points);
    return std::max(0.5, 0.4 * (l.x.place(x + spacing) - l.x.place(x)));
}

void draw_series(
    const Chart& chart, const LegendItem& item, const Series& s, const Layout& l, Canvas& canvas) {
    const std::vector<CanvasPoint> shown = shown_points(chart, s);
    std::vector<CanvasPoint> places;
    for (const CanvasPoint& p : shown) places.push_back(l.place(p));
    const auto draw_marks = [&](double radius) {
        for (const CanvasPoint& p : places) draw_mark(canvas, item, p, radius);
    };
    switch (s.style) {
        case SeriesStyle::bars:
            for (const CanvasPoint& p : shown) {
                const Area a = bar_area(l, p, bar_half_px(l, shown));
                const std::array<CanvasPoint, 4> bar{{{a.left, a.bottom},
                                                      {a.left + a.width, a.bottom},
                                                      {a.left + a.width, a.bottom + a.height},
                                                      {a.left, a.bottom + a.height}}};
                canvas.fill(bar, item.colour);
            }
            break;
        case SeriesStyle::line:
        case SeriesStyle::dashed:
        case SeriesStyle::line_and_points:
            canvas.line(places, s.width_px, item.colour, s.style == SeriesStyle::dashed ? 6 : 0);
            if (s.style == SeriesStyle::line_and_points || places.size() == 1)
                draw_marks(kLineMarkPx);
            break;
        case SeriesStyle::points:
        case SeriesStyle::crosses:
        case SeriesStyle::diamonds: draw_marks(1.5 * s.width_px); break;
    }
}

// Whether a series comes near a rectangle. Lines are followed in steps of 4 pixels.
bool touches(const Chart& chart, const Series& s, const Layout& l, const Area& box) {
    const std::vector<CanvasPoint> shown = shown_points(chart, s);
    const bool marks = s.style == SeriesStyle::points || s.style == SeriesStyle::crosses ||
                       s.style == SeriesStyle::diamonds;
    const bool bars = s.style == SeriesStyle::bars;
    const double margin = bars    ? bar_half_px(l, shown)
                          : marks ? 1.5 * s.width_px + 2
                                  : kLineMarkPx + 2;
    for (std::size_t i = 0; i < shown.size(); ++i) {
        const CanvasPoint a = l.place(shown[i]);
        CanvasPoint b = a;
        if (bars) b.y = bar_area(l, shown[i], 0).bottom;
        if (!bars && !marks && i > 0) b = l.place(shown[i - 1]);
        const int steps = 1 + static_cast<int>(std::hypot(b.x - a.x, b.y - a.y) / 4);
        for (int k = 0; k <= steps; ++k) {
            const double x = a.x + (b.x - a.x) * k / steps, y = a.y + (b.y - a.y) * k / steps;
            if (x > box.left - margin && x < box.left + box.width + margin &&
                y > box.bottom - margin && y < box.bottom + box.height + margin)
                return true;
        }
    }
    return false;
}

// A short legend takes a free corner of the plot. If there is none, or if it is long, it is placed
// beside the plot, and one with long names below it: the area of the plot shrinks.
CanvasPoint place_legend(const Chart& chart, const Legend& legend, Area& area, Layout& l) {
    if (legend.entries.size() < 5 && legend.width < 0.45 * area.width) {
        const double left = l.x.from_px + kGapPx, right = l.right() - legend.width - kGapPx;
        const double top = l.top() - legend.height - kGapPx, bottom = l.y.from_px + kGapPx;
        for (const CanvasPoint corner : {CanvasPoint{right, top}, CanvasPoint{left, top},
                                         CanvasPoint{right, bottom}, CanvasPoint{left, bottom}}) {
            const Area box{corner.x, corner.y, legend.width, legend.height};
            if (std::none_of(chart.series.begin(), chart.series.end(),
                             [&](const Series& s) { return touches(chart, s, l, box); }))
                return corner;
        }
    }
    if (legend.width < 0.35 * area.width) {
        const double left = area.left + area.width - legend.width - kGapPx;
        area.width -= legend.width + kGapPx;
        l = lay_out(chart, area);
        return {left, std::max(l.top() - legend.height, area.bottom + 1)};
    }
    const CanvasPoint corner{area.left + kGapPx, area.bottom + kGapPx / 2};
    area.bottom += legend.height + kGapPx;
    area.height -= legend.height + kGapPx;
    l = lay_out(chart, area);
    return corner;
}

// The picture of a chart, enlarged and centred in its cell.
void draw_picture(const Chart& chart, const Area& cell, Canvas& canvas) {
    const int w = chart.picture_width, h = chart.picture_height;
    const double room_x = cell.width - 2 * kGapPx, room_y = cell.height - kTitleTextPx - kGapPx;
    const int factor = std::max(1, static_cast<int>(std::min(room_x / w, room_y / h)));
    canvas.grey_picture(
        chart.picture, w, h, factor,
        {cell.left + std::floor(0.5 * (cell.width - factor * w)), cell.bottom + kGapPx});
}

// Names above their bars, values behind them; below the rows the unit and what the marks mean.
void draw_rows(const Chart& chart, const Area& cell, Canvas& canvas) {
    constexpr double kMaxPx = 44, kValuePx = 48, kBarPx = 14, kMarkPx = 6;
    const TextStyle words{.colour = kInk}, bold{.bold = true, .colour = kInk};
    double longest = 0;
    int rows = 0;
    for (const Series& s : chart.series) {
        rows += s.style == SeriesStyle::bars;
        for (const CanvasPoint& p : shown_points(chart, s)) longest = std::max(longest, p.y);
    }
    if (rows == 0) return;
    const double left = cell.left + 2 * kGapPx, width = cell.width - 4 * kGapPx - kValuePx,
                 top = cell.bottom + cell.height - kTitleTextPx - kGapPx,
                 pitch = std::min(kMaxPx, (top - cell.bottom - 3 * kLabelTextPx) / rows);
    const auto length = [&](double value) {
        return longest > 0 ? width * std::max(0.0, value) / longest : 0;
    };
    const auto bar_bottom = [&](double row) {
        return top - (row - 1) * pitch - kTickTextPx - 3 - kBarPx;
    };
    const double unit = bar_bottom(rows) - kLabelTextPx - kGapPx, marks = unit - kLabelTextPx;
    canvas.text(chart.y_label, {left, unit}, words);
    double row = 0, beside = left;
    for (std::size_t n = 0; n < chart.series.size(); ++n) {
        const Series& s = chart.series[n];
        const std::vector<CanvasPoint> shown = shown_points(chart, s);
        if (s.style == SeriesStyle::bars) {
            const double bottom = bar_bottom(++row);
            canvas.text(shortened(s.name, words, cell.width - 3 * kGapPx),
                        {left, bottom + kBarPx + 5}, words);
            if (shown.empty()) continue;
            const double value = shown[0].y, end = left + std::max(1.0, length(value));
            const std::array<CanvasPoint, 4> bar{
                {{left, bottom}, {end, bottom}, {end, bottom + kBarPx}, {left, bottom + kBarPx}}};
            canvas.fill(bar, colour_of(s, 0));
            canvas.text(fixed_text(value, value < 10 ? 2 : 1), {end + kGapPx, bottom + 2}, bold);
            continue;
        }
        const LegendItem item{s.name, s.style, colour_of(s, n), s.width_px};
        for (const CanvasPoint& p : shown)
            draw_mark(canvas, item, {left + length(p.y), bar_bottom(p.x) + 0.5 * kBarPx}, kMarkPx);
        draw_mark(canvas, item, {beside + kMarkPx, marks + 4}, kMarkPx);
        canvas.text(s.name, {beside + 3 * kMarkPx, marks}, words);
        beside += 5 * kMarkPx + text_width_px(s.name, words);
    }
}

void draw_chart(const Chart& chart, const Area& cell, Canvas& canvas) {
    draw_title(canvas, chart.title,
               {cell.left + 0.5 * cell.width, cell.bottom + cell.height - kTitleTextPx + 9},
               {.size_px = 16, .bold = true}, cell.width - 2 * kGapPx);
    if (!chart.picture.empty()) {
        draw_picture(chart, cell, canvas);
        return;
    }
    if (chart.rows) {
        draw_rows(chart, cell, canvas);
        return;
    }
    std::vector<LegendItem> items, named;
    for (std::size_t n = 0; n < chart.series.size(); ++n) {
        const Series& s = chart.series[n];
        items.push_back({s.name, s.style, colour_of(s, n), s.width_px});
        if (!s.name.empty() && !shown_points(chart, s).empty()) named.push_back(items.back());
    }
    Area area = cell;
    Layout layout = lay_out(chart, area);
    const Legend legend = lay_out_legend(named, cell.width - 2 * kGapPx);
    CanvasPoint corner;
    if (!named.empty()) corner = place_legend(chart, legend, area, layout);
    draw_axes(chart, layout, area, canvas);
    canvas.clip(layout.x.from_px, layout.y.from_px, layout.x.length_px, layout.y.length_px);
    for (std::size_t n = 0; n < chart.series.size(); ++n)
        draw_series(chart, items[n], chart.series[n], layout, canvas);
    canvas.clip();
    draw_legend(canvas, legend, corner);
}

Canvas drawn(const ChartSheet& sheet) {
    const int count = static_cast<int>(sheet.charts.size());
    const int across = std::max(1, std::min(sheet.columns, count));
    const int down = std::max(1, (count + across - 1) / across);
    Canvas canvas(across * sheet.width_px, down * sheet.height_px);
    for (int i = 0; i < count; ++i) {
        const int row = i / across;
        const Area cell{1.0 * (i % across) * sheet.width_px,
                        1.0 * (down - 1 - row) * sheet.height_px, 1.0 * sheet.width_px,
                        1.0 * sheet.height_px};
        draw_chart(sheet.charts[i], cell, canvas);
    }
    return canvas;
}

}  // namespace

Status write_chart_png(const ChartSheet& sheet, const std::string& path) {
    const Canvas canvas = drawn(sheet);
    const std::vector<std::uint8_t> png =
        png_from_rgb(canvas.rgb().data(), canvas.width(), canvas.height());
    return write_file(path, std::span<const std::uint8_t>(png));
}

std::string chart_svg(const ChartSheet& sheet) {
    return drawn(sheet).svg();
}

Status write_chart_svg(const ChartSheet& sheet, const std::string& path) {
    return write_file(path, std::string_view(chart_svg(sheet)));
}

}  // namespace sonocase::pipeline::inline pictures
