// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart.h"

#include <vtkAxis.h>
#include <vtkChartXY.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPen.h>
#include <vtkPlot.h>
#include <vtkPlotPoints.h>
#include <vtkSmartPointer.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "pipeline/pictures/canvas.h"
#include "pipeline/pictures/canvas_device.h"
#include "pipeline/pictures/chart_legend.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline {
namespace {

// Distinct for most colour-blind readers as well (the set of Okabe and Ito without black).
constexpr std::array<std::array<std::uint8_t, 3>, 7> kPalette{{{0, 114, 178},
                                                               {213, 94, 0},
                                                               {0, 158, 115},
                                                               {204, 121, 167},
                                                               {230, 159, 0},
                                                               {86, 180, 233},
                                                               {120, 120, 120}}};

struct Range {
    double low = INFINITY, high = -INFINITY;
    void include(double v) {
        low = std::min(low, v);
        high = std::max(high, v);
    }
};

void set_axis(vtkAxis* axis, const std::string& title, Range range, bool log_scale) {
    axis->SetTitle(title);
    axis->GetTitleProperties()->SetFontSize(14);
    axis->GetTitleProperties()->SetBold(0);
    axis->GetLabelProperties()->SetFontSize(12);
    axis->GetGridPen()->SetColor(225, 225, 225);
    axis->GetPen()->SetColor(60, 60, 60);
    axis->SetBehavior(vtkAxis::FIXED);
    if (log_scale) axis->SetLogScale(true);
    axis->SetRange(range.low, range.high);
}

bool is_shown(const Chart& chart, double x, double y) {
    return std::isfinite(x) && std::isfinite(y) && !(chart.x_log && x <= 0) &&
           !(chart.y_log && y <= 0);
}

// A margin on either side of the data; a range of its own if there are none.
void pad(Range& r, bool log_scale) {
    if (!(r.low <= r.high)) r = log_scale ? Range{1, 10} : Range{0, 1};
    if (log_scale) {
        const double span = std::max(1.3, std::pow(r.high / r.low, 0.08));
        r.low /= span;
        r.high *= span;
    } else {
        const double span =
            r.high > r.low ? 0.06 * (r.high - r.low) : std::max(1e-6, 0.1 * std::abs(r.high));
        r.low -= span;
        r.high += span;
    }
}

// Sets both axes of a chart of this size from the data.
void set_axes(const Chart& given, int width, int height, vtkChartXY& chart) {
    Range rx, ry;
    for (const Series& s : given.series) {
        if (s.look == SeriesLook::bars && !given.y_log) ry.include(0);
        for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
            if (!is_shown(given, s.x[i], s.y[i])) continue;
            rx.include(s.x[i]);
            ry.include(s.y[i]);
        }
    }
    pad(rx, given.x_log);
    pad(ry, given.y_log);
    if (given.equal_axes) {
        // The plot area is about 90 pixels narrower and 100 lower than the chart.
        const double per_px = std::max((rx.high - rx.low) / std::max(10, width - 90),
                                       (ry.high - ry.low) / std::max(10, height - 100));
        const double cx = 0.5 * (rx.low + rx.high), cy = 0.5 * (ry.low + ry.high);
        rx = {cx - 0.5 * per_px * (width - 90), cx + 0.5 * per_px * (width - 90)};
        ry = {cy - 0.5 * per_px * (height - 100), cy + 0.5 * per_px * (height - 100)};
    }
    set_axis(chart.GetAxis(vtkAxis::BOTTOM), given.x_label, rx, given.x_log);
    set_axis(chart.GetAxis(vtkAxis::LEFT), given.y_label, ry, given.y_log);
    chart.GetAxis(vtkAxis::BOTTOM)->Update();
    chart.GetAxis(vtkAxis::LEFT)->Update();
}

CanvasColour colour_of(const Series& s, std::size_t number) {
    const bool own = s.colour != std::array<std::uint8_t, 3>{0, 0, 0};
    const auto c = own ? s.colour : kPalette[number % kPalette.size()];
    return {c[0], c[1], c[2], 255};
}

// The pairs of a series that are shown, or null if there are none.
vtkSmartPointer<vtkTable> table_of(const Chart& chart, const Series& s) {
    vtkNew<vtkDoubleArray> ax, ay;
    ax->SetName("x");
    ay->SetName(s.name.empty() ? "y" : s.name.c_str());
    for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
        if (!is_shown(chart, s.x[i], s.y[i])) continue;
        ax->InsertNextValue(s.x[i]);
        ay->InsertNextValue(s.y[i]);
    }
    if (ax->GetNumberOfValues() == 0) return nullptr;
    // VTK does not draw a series of one point: the point is given twice.
    if (ax->GetNumberOfValues() == 1) {
        ax->InsertNextValue(ax->GetValue(0));
        ay->InsertNextValue(ay->GetValue(0));
    }
    auto table = vtkSmartPointer<vtkTable>::New();
    table->AddColumn(ax);
    table->AddColumn(ay);
    return table;
}

void add_plots(const Series& s, vtkTable* table, CanvasColour colour, vtkChartXY& chart) {
    const auto add = [&](int kind, double size) {
        vtkPlot* plot = chart.AddPlot(kind);
        plot->SetInputData(table, 0, 1);
        plot->SetColor(colour[0], colour[1], colour[2], 255);
        plot->SetWidth(static_cast<float>(size));
        return plot;
    };
    const auto add_marks = [&](double size) {
        auto* points = vtkPlotPoints::SafeDownCast(add(vtkChart::POINTS, size));
        points->SetMarkerStyle(s.look == SeriesLook::crosses    ? vtkPlotPoints::CROSS
                               : s.look == SeriesLook::diamonds ? vtkPlotPoints::DIAMOND
                                                                : vtkPlotPoints::CIRCLE);
        points->SetMarkerSize(static_cast<float>(size));
    };
    switch (s.look) {
        case SeriesLook::bars: add(vtkChart::BAR, s.width_px); break;
        case SeriesLook::line:
        case SeriesLook::dashed:
        case SeriesLook::line_and_points:
            add(vtkChart::LINE, s.width_px)
                ->GetPen()
                ->SetLineType(s.look == SeriesLook::dashed ? vtkPen::DASH_LINE
                                                           : vtkPen::SOLID_LINE);
            if (s.look == SeriesLook::line_and_points) add_marks(7);
            break;
        case SeriesLook::points:
        case SeriesLook::crosses:
        case SeriesLook::diamonds: add_marks(3 * s.width_px); break;
    }
}

// The picture of a chart, enlarged and centred in a cell whose lower left corner is (x, y).
void paint_picture(const Chart& given, Canvas& canvas, double x, double y, int width, int height) {
    constexpr int kTitlePx = 36, kMarginPx = 8;
    const int w = given.picture_width, h = given.picture_height;
    const int factor =
        std::max(1, std::min((width - 2 * kMarginPx) / w, (height - kTitlePx - kMarginPx) / h));
    const double left = x + (width - factor * w) / 2;
    for (int row = 0; row < h; ++row) {
        const std::uint8_t* grey =
            given.picture.data() + static_cast<std::size_t>(w) * static_cast<std::size_t>(row);
        const double bottom = y + kMarginPx + factor * (h - 1 - row);
        for (int i = 0; i < w;) {  // runs of one grey
            int end = i + 1;
            while (end < w && grey[end] == grey[i]) ++end;
            const double a = left + factor * i, b = left + factor * end;
            const std::array<CanvasPoint, 4> box{
                {{a, bottom}, {b, bottom}, {b, bottom + factor}, {a, bottom + factor}}};
            canvas.fill(box, CanvasColour{grey[i], grey[i], grey[i], 255});
            i = end;
        }
    }
}

// A legend with few, short entries covers the upper right corner of the plot; a longer one is
// placed beside the plot, and one with long names below it.
enum class LegendPlace { inside, beside, below };

LegendPlace place_of(const Legend& legend, int width) {
    if (legend.entries.size() < 5 && legend.width < 0.45 * width) return LegendPlace::inside;
    return legend.width < 0.4 * width ? LegendPlace::beside : LegendPlace::below;
}

void paint(const Chart& given, Canvas& canvas, double x, double y, int width, int height) {
    constexpr int kGapPx = 8;
    std::vector<LegendItem> items;
    std::vector<vtkSmartPointer<vtkTable>> tables;
    for (std::size_t number = 0; number < given.series.size(); ++number) {
        const Series& s = given.series[number];
        tables.push_back(table_of(given, s));
        if (tables.back() && !s.name.empty())
            items.push_back({s.name, s.look, colour_of(s, number), s.width_px});
    }
    const Legend legend = lay_out_legend(items, width - 2 * kGapPx);
    const LegendPlace place = place_of(legend, width);
    SceneArea area{x, y, width, height};
    if (place == LegendPlace::beside) area.width_px -= static_cast<int>(legend.width) + kGapPx;
    if (place == LegendPlace::below) {
        const int room = static_cast<int>(legend.height) + kGapPx;
        area.bottom_px += room;
        area.height_px -= room;
    }

    vtkNew<vtkContextScene> scene;
    scene->SetGeometry(area.width_px, area.height_px);
    vtkNew<vtkChartXY> chart;
    scene->AddItem(chart);
    chart->SetTitle(given.title);
    chart->GetTitleProperties()->SetFontSize(16);
    chart->GetTitleProperties()->SetBold(1);
    chart->GetTitleProperties()->SetColor(0.1, 0.1, 0.1);
    // The axes come first: a plot takes its logarithms when it is added.
    set_axes(given, area.width_px, area.height_px, *chart);
    for (std::size_t number = 0; number < given.series.size(); ++number) {
        const Series& s = given.series[number];
        if (tables[number]) add_plots(s, tables[number], colour_of(s, number), *chart);
    }
    chart->SetShowLegend(false);
    chart->SetRenderEmpty(true);
    if (!given.picture.empty()) {
        for (const int axis : {vtkAxis::LEFT, vtkAxis::BOTTOM, vtkAxis::RIGHT, vtkAxis::TOP})
            chart->GetAxis(axis)->SetVisible(false);
    }
    paint_scene(*scene, canvas, area);

    const int* top_right = chart->GetPoint2();  // of the plot, in the scene
    const double plot_top = area.bottom_px + top_right[1];
    CanvasPoint corner{x + kGapPx, y + kGapPx / 2};
    if (place == LegendPlace::inside) {
        corner = {x + top_right[0] - legend.width - kGapPx, plot_top - legend.height - kGapPx};
    } else if (place == LegendPlace::beside) {
        corner = {x + width - legend.width - kGapPx, std::max(plot_top - legend.height, y + 1)};
    }
    draw_legend(canvas, legend, corner);
    if (!given.picture.empty()) paint_picture(given, canvas, x, y, width, height);
}

Canvas painted(const ChartSheet& sheet) {
    const int count = static_cast<int>(sheet.charts.size());
    const int across = std::max(1, std::min(sheet.columns, count));
    const int down = std::max(1, (count + across - 1) / across);
    Canvas canvas(across * sheet.width_px, down * sheet.height_px);
    for (int i = 0; i < count; ++i) {
        paint(sheet.charts[static_cast<std::size_t>(i)], canvas, i % across * sheet.width_px,
              (down - 1 - i / across) * sheet.height_px, sheet.width_px, sheet.height_px);
    }
    return canvas;
}

}  // namespace

Status write_chart_png(const ChartSheet& sheet, const std::string& path) {
    const Canvas canvas = painted(sheet);
    const std::vector<std::uint8_t> png =
        png_from_rgb(canvas.rgb().data(), canvas.width(), canvas.height());
    return write_file(path, std::span<const std::uint8_t>(png));
}

Status write_chart_svg(const ChartSheet& sheet, const std::string& path) {
    return write_file(path, std::string_view(painted(sheet).svg()));
}

}  // namespace sonocase::pipeline
