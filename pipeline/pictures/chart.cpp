#include "pipeline/pictures/chart.h"

#include <vtkAutoInit.h>
#include <vtkAxis.h>
#include <vtkChartLegend.h>
#include <vtkChartXY.h>
#include <vtkContextActor.h>
#include <vtkContextScene.h>
#include <vtkContextView.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkObject.h>
#include <vtkPNGWriter.h>
#include <vtkPen.h>
#include <vtkPlot.h>
#include <vtkPlotPoints.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSVGExporter.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>
#include <vtkWindowToImageFilter.h>

#include <cmath>
#include <cstdio>
#include <functional>

#include "pipeline/pictures/offscreen_display.h"

VTK_MODULE_INIT(vtkRenderingOpenGL2)
VTK_MODULE_INIT(vtkRenderingContextOpenGL2)
VTK_MODULE_INIT(vtkRenderingFreeType)

namespace sonocase::pipeline {
namespace {

// Distinct also for most colour-blind readers (Okabe and Ito's set, black left out).
constexpr std::array<std::array<std::uint8_t, 3>, 7> kPalette{{{0, 114, 178},
                                                               {213, 94, 0},
                                                               {0, 158, 115},
                                                               {204, 121, 167},
                                                               {230, 159, 0},
                                                               {86, 180, 233},
                                                               {120, 120, 120}}};

void label_axis(vtkAxis* axis, const std::string& title, bool logarithmic) {
    axis->SetTitle(title);
    axis->SetLogScale(logarithmic);
    axis->GetTitleProperties()->SetFontSize(14);
    axis->GetLabelProperties()->SetFontSize(12);
    axis->GetGridPen()->SetColor(225, 225, 225);
}

void add_series(vtkChartXY* chart, const Chart& description, std::size_t number) {
    const Series& series = description.series[number];
    vtkNew<vtkDoubleArray> x, y;
    x->SetName("x");
    y->SetName(series.name.empty() ? "y" : series.name.c_str());
    for (std::size_t i = 0; i < series.x.size() && i < series.y.size(); ++i) {
        const double a = series.x[i], b = series.y[i];
        if (!std::isfinite(a) || !std::isfinite(b)) continue;
        if ((description.x_log && a <= 0) || (description.y_log && b <= 0)) continue;
        x->InsertNextValue(a);
        y->InsertNextValue(b);
    }
    if (x->GetNumberOfTuples() == 0) return;
    vtkNew<vtkTable> table;
    table->AddColumn(x);
    table->AddColumn(y);

    const bool points =
        series.look == SeriesLook::points || series.look == SeriesLook::line_and_points;
    vtkPlot* plot = chart->AddPlot(series.look == SeriesLook::bars     ? vtkChart::BAR
                                   : series.look == SeriesLook::points ? vtkChart::POINTS
                                                                       : vtkChart::LINE);
    plot->SetInputData(table, 0, 1);
    const bool own = series.colour != std::array<std::uint8_t, 3>{0, 0, 0};
    const auto colour = own ? series.colour : kPalette[number % kPalette.size()];
    plot->SetColor(colour[0], colour[1], colour[2], 255);
    plot->SetWidth(static_cast<float>(series.width_px));
    if (auto* marked = vtkPlotPoints::SafeDownCast(plot)) {
        marked->SetMarkerStyle(points ? vtkPlotPoints::CIRCLE : vtkPlotPoints::NONE);
        marked->SetMarkerSize(
            static_cast<float>(series.look == SeriesLook::points ? 3 * series.width_px : 7));
    }
    if (series.look == SeriesLook::dashed) plot->GetPen()->SetLineType(vtkPen::DASH_LINE);
    plot->SetLegendVisibility(!series.name.empty());
}

// Builds the view, then hands it to `write`.
Status with_view(const ChartSheet& sheet, const std::function<void(vtkContextView*)>& write) {
    if (const Status display = ensure_display(); !display) return display.error();
    const int count = static_cast<int>(sheet.charts.size());
    const int columns = std::max(1, std::min(sheet.columns, count));
    const int rows = (count + columns - 1) / columns;
    // Its complaints come as failed files, which we report in our own words.
    vtkObject::GlobalWarningDisplayOff();
    vtkNew<vtkContextView> view;
    view->GetRenderWindow()->SetOffScreenRendering(1);
    view->GetRenderWindow()->SetMultiSamples(8);
    view->GetRenderWindow()->SetSize(columns * sheet.width_px, rows * sheet.height_px);
    view->GetRenderer()->SetBackground(1, 1, 1);
    for (int i = 0; i < count; ++i) {
        const Chart& description = sheet.charts[static_cast<std::size_t>(i)];
        vtkNew<vtkChartXY> chart;
        chart->SetAutoSize(false);
        const int column = i % columns, row = i / columns;
        chart->SetSize(vtkRectf(static_cast<float>(column * sheet.width_px),
                                static_cast<float>((rows - 1 - row) * sheet.height_px),
                                static_cast<float>(sheet.width_px),
                                static_cast<float>(sheet.height_px)));
        chart->SetTitle(description.title);
        chart->GetTitleProperties()->SetFontSize(16);
        chart->SetShowLegend(true);
        chart->GetLegend()->SetLabelSize(12);
        label_axis(chart->GetAxis(vtkAxis::BOTTOM), description.x_label, description.x_log);
        label_axis(chart->GetAxis(vtkAxis::LEFT), description.y_label, description.y_log);
        for (std::size_t s = 0; s < description.series.size(); ++s)
            add_series(chart, description, s);
        chart->RecalculateBounds();
        view->GetScene()->AddItem(chart);
    }
    view->GetRenderWindow()->Render();
    write(view);
    return Done{};
}

Status moved_into_place(const std::string& temporary, const std::string& path) {
    if (std::rename(temporary.c_str(), path.c_str()) != 0) {
        std::remove(temporary.c_str());
        return Error{"the picture cannot be written", path,
                     "check the folder and the space on its disk"};
    }
    return Done{};
}

}  // namespace

Status write_chart_png(const ChartSheet& sheet, const std::string& path) {
    const std::string temporary = path + ".part";
    const Status drawn = with_view(sheet, [&](vtkContextView* view) {
        vtkNew<vtkWindowToImageFilter> grab;
        grab->SetInput(view->GetRenderWindow());
        grab->ReadFrontBufferOff();
        vtkNew<vtkPNGWriter> writer;
        writer->SetInputConnection(grab->GetOutputPort());
        writer->SetFileName(temporary.c_str());
        writer->Write();
    });
    if (!drawn) return drawn;
    return moved_into_place(temporary, path);
}

Status write_chart_svg(const ChartSheet& sheet, const std::string& path) {
    const std::string temporary = path + ".part";
    const Status drawn = with_view(sheet, [&](vtkContextView* view) {
        vtkNew<vtkSVGExporter> writer;
        writer->SetRenderWindow(view->GetRenderWindow());
        writer->SetFileName(temporary.c_str());
        writer->Write();
    });
    if (!drawn) return drawn;
    return moved_into_place(temporary, path);
}

}  // namespace sonocase::pipeline
