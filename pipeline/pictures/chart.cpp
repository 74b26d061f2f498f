// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart.h"

#include <vtkAutoInit.h>
#include <vtkAxis.h>
#include <vtkBrush.h>
#include <vtkChartLegend.h>
#include <vtkChartXY.h>
#include <vtkContext2D.h>
#include <vtkContextDevice2D.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkImageData.h>
#include <vtkMatrix3x3.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkPNGWriter.h>
#include <vtkPen.h>
#include <vtkPlot.h>
#include <vtkPlotPoints.h>
#include <vtkSmartPointer.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>
#include <vtkUnicodeString.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "pipeline/pictures/canvas.h"

// VTK finds its text renderer through an object factory.
VTK_MODULE_INIT(vtkRenderingFreeType)

namespace sonocase::pipeline {
namespace {

constexpr int kDpi = 72;

// Distinct also for most colour-blind readers (Okabe and Ito's set, black left out).
constexpr std::array<std::array<std::uint8_t, 3>, 7> kPalette{{{0, 114, 178},
                                                               {213, 94, 0},
                                                               {0, 158, 115},
                                                               {204, 121, 167},
                                                               {230, 159, 0},
                                                               {86, 180, 233},
                                                               {120, 120, 120}}};

// Hands what VTK's 2-D context draws to a canvas.
class CanvasDevice : public vtkContextDevice2D {
  public:
    static CanvasDevice* New();
    vtkTypeMacro(CanvasDevice, vtkContextDevice2D);

    void open(Canvas* canvas) { canvas_ = canvas; }
    // Everything is drawn this far to the right and up.
    void shift(double x, double y) {
        shift_x_ = x;
        shift_y_ = y;
    }

    void DrawPoly(float* p, int n, unsigned char* colours, int components) override {
        canvas_->line(points(p, n), Pen->GetWidth(), pen(colours, components), dash());
    }
    void DrawLines(float* p, int n, unsigned char* colours, int components) override {
        for (int i = 0; i + 1 < n; i += 2) {
            canvas_->line(points(p + 2 * i, 2), Pen->GetWidth(), pen(colours, components), dash());
        }
    }
    void DrawPoints(float* p, int n, unsigned char* colours, int components) override {
        for (const CanvasPoint& c : points(p, n)) {
            canvas_->disc(c, 0.5 * Pen->GetWidth(), pen(colours, components));
        }
    }
    void DrawPointSprites(
        vtkImageData*, float* p, int n, unsigned char* colours, int components) override {
        DrawPoints(p, n, colours, components);
    }
    void DrawMarkers(
        int shape, bool, float* p, int n, unsigned char* colours, int components) override {
        const CanvasColour colour = pen(colours, components);
        const double r = 0.5 * Pen->GetWidth();
        for (const CanvasPoint& c : points(p, n)) {
            const auto stroke = [&](double ax, double ay, double bx, double by) {
                const std::array<CanvasPoint, 2> s{{{c.x + ax, c.y + ay}, {c.x + bx, c.y + by}}};
                canvas_->line(s, 1.6, colour);
            };
            const std::array<CanvasPoint, 4> box{
                {{c.x - r, c.y - r}, {c.x + r, c.y - r}, {c.x + r, c.y + r}, {c.x - r, c.y + r}}};
            const std::array<CanvasPoint, 4> rhomb{
                {{c.x - r, c.y}, {c.x, c.y - r}, {c.x + r, c.y}, {c.x, c.y + r}}};
            switch (shape) {
                case vtkPlotPoints::CROSS:
                    stroke(-r, -r, r, r);
                    stroke(-r, r, r, -r);
                    break;
                case vtkPlotPoints::PLUS:
                    stroke(-r, 0, r, 0);
                    stroke(0, -r, 0, r);
                    break;
                case vtkPlotPoints::SQUARE:
                    canvas_->fill(box, colour);
                    break;
                case vtkPlotPoints::DIAMOND:
                    canvas_->fill(rhomb, colour);
                    break;
                default:
                    canvas_->disc(c, r, colour);
            }
        }
    }
    void DrawQuad(float* p, int n) override {
        for (int i = 0; i + 3 < n; i += 4) canvas_->fill(points(p + 2 * i, 4), brush());
    }
    void DrawQuadStrip(float* p, int n) override {
        for (int i = 0; i + 3 < n; i += 2) {
            std::vector<CanvasPoint> q = points(p + 2 * i, 4);
            std::swap(q[2], q[3]);
            canvas_->fill(q, brush());
        }
    }
    void DrawPolygon(float* p, int n) override { canvas_->fill(points(p, n), brush()); }
    void DrawColoredPolygon(float* p, int n, unsigned char*, int) override { DrawPolygon(p, n); }
    void DrawEllipseWedge(float, float, float, float, float, float, float, float) override {}
    void DrawEllipticArc(float, float, float, float, float, float) override {}

    void DrawString(float* point, const vtkStdString& string) override {
        if (string.empty()) return;
        vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
        vtkNew<vtkTextProperty> prop;
        prop->ShallowCopy(TextProp);
        vtkNew<vtkImageData> image;
        int used[2] = {0, 0};
        if (!renderer || !renderer->RenderString(prop, string, image, used, kDpi)) {
            return;
        }
        // The picture's extent is relative to the anchor.
        int e[6];
        image->GetExtent(e);
        const int across_px = e[1] - e[0] + 1, up_px = e[3] - e[2] + 1;
        std::vector<std::uint8_t> mask;
        mask.reserve(static_cast<std::size_t>(across_px) * static_cast<std::size_t>(up_px));
        for (int j = e[2]; j <= e[3]; ++j) {
            for (int i = e[0]; i <= e[1]; ++i) {
                mask.push_back(
                    static_cast<std::uint8_t>(image->GetScalarComponentAsDouble(i, j, 0, 3)));
            }
        }
        const CanvasPoint at = points(point, 1)[0];
        double rgb[3];
        prop->GetColor(rgb);
        const auto level = [](double v) { return static_cast<std::uint8_t>(std::lround(255 * v)); };
        // The box is relative to the anchor; in the SVG the base line has to be found from it.
        Canvas::Text text;
        text.text = string;
        text.degrees = prop->GetOrientation();
        text.size_px = prop->GetFontSize();
        text.bold = prop->GetBold() != 0;
        const int across = prop->GetJustification();
        text.anchor = across == VTK_TEXT_LEFT    ? "start"
                      : across == VTK_TEXT_RIGHT ? "end"
                                                 : "middle";
        const int up = prop->GetVerticalJustification();
        const double drop = up == VTK_TEXT_TOP ? -0.8 : up == VTK_TEXT_CENTERED ? -0.35 : 0.0;
        const double turn = text.degrees * 3.14159265358979323846 / 180;
        text.at = {at.x - std::sin(turn) * drop * text.size_px,
                   at.y + std::cos(turn) * drop * text.size_px};
        canvas_->text(mask, across_px, up_px, static_cast<int>(std::lround(at.x)) + e[0],
                      static_cast<int>(std::lround(at.y)) + e[2],
                      {level(rgb[0]), level(rgb[1]), level(rgb[2]), 255}, text);
    }
    void ComputeStringBounds(const vtkStdString& string, float bounds[4]) override {
        int box[4] = {0, 0, 0, 0};
        vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
        if (renderer) renderer->GetBoundingBox(TextProp, string, box, kDpi);
        bounds[0] = static_cast<float>(box[0]);
        bounds[1] = static_cast<float>(box[2]);
        bounds[2] = static_cast<float>(box[1] - box[0] + 1);
        bounds[3] = static_cast<float>(box[3] - box[2] + 1);
    }
    void DrawString(float* point, const vtkUnicodeString& string) override {
        DrawString(point, vtkStdString(string.utf8_str()));
    }
    void ComputeStringBounds(const vtkUnicodeString& string, float bounds[4]) override {
        ComputeStringBounds(vtkStdString(string.utf8_str()), bounds);
    }
    void ComputeJustifiedStringBounds(const char* string, float bounds[4]) override {
        ComputeStringBounds(vtkStdString(string), bounds);
    }
    void DrawMathTextString(float* point, const vtkStdString& string) override {
        DrawString(point, string);
    }
    void DrawImage(float[2], float, vtkImageData*) override {}
    void DrawImage(const vtkRectf&, vtkImageData*) override {}
    void SetColor4(unsigned char*) override {}
    void SetTexture(vtkImageData*, int) override {}
    void SetPointSize(float) override {}
    void SetLineWidth(float) override {}
    void SetLineType(int) override {}
    void SetMatrix(vtkMatrix3x3* m) override { matrix_->DeepCopy(m); }
    void GetMatrix(vtkMatrix3x3* m) override { m->DeepCopy(matrix_); }
    void MultiplyMatrix(vtkMatrix3x3* m) override {
        vtkMatrix3x3::Multiply3x3(matrix_, m, matrix_);
    }
    void PushMatrix() override {
        vtkSmartPointer<vtkMatrix3x3> copy = vtkSmartPointer<vtkMatrix3x3>::New();
        copy->DeepCopy(matrix_);
        stack_.push_back(copy);
    }
    void PopMatrix() override {
        if (stack_.empty()) return;
        matrix_->DeepCopy(stack_.back());
        stack_.pop_back();
    }
    void SetClipping(int* x) override {
        clip_ = {x[0] + shift_x_, x[1] + shift_y_, static_cast<double>(x[2]),
                 static_cast<double>(x[3])};
    }
    void EnableClipping(bool on) override {
        if (on) {
            canvas_->clip(clip_[0], clip_[1], clip_[2], clip_[3]);
        } else {
            canvas_->clip();
        }
    }
    void size(int width, int height) {
        Geometry[0] = width;
        Geometry[1] = height;
    }

  private:
    std::vector<CanvasPoint> points(const float* p, int n) const {
        std::vector<CanvasPoint> out;
        out.reserve(static_cast<std::size_t>(n));
        const double* m = matrix_->GetData();
        for (int i = 0; i < n; ++i) {
            const double x = p[2 * i], y = p[2 * i + 1];
            out.push_back(
                {m[0] * x + m[1] * y + m[2] + shift_x_, m[3] * x + m[4] * y + m[5] + shift_y_});
        }
        return out;
    }
    CanvasColour pen(const unsigned char* colours, int components) const {
        if (colours && components >= 3) return {colours[0], colours[1], colours[2], 255};
        unsigned char c[4];
        Pen->GetColor(c);
        c[3] = Pen->GetOpacity();
        if (Pen->GetLineType() == vtkPen::NO_PEN) c[3] = 0;
        return {c[0], c[1], c[2], c[3]};
    }
    CanvasColour brush() const {
        unsigned char c[4];
        Brush->GetColor(c);
        return {c[0], c[1], c[2], c[3]};
    }
    double dash() const {
        return Pen->GetLineType() == vtkPen::DASH_LINE  ? 6
               : Pen->GetLineType() == vtkPen::DOT_LINE ? 2
                                                        : 0;
    }

    Canvas* canvas_ = nullptr;
    vtkNew<vtkMatrix3x3> matrix_;
    std::vector<vtkSmartPointer<vtkMatrix3x3>> stack_;
    std::array<double, 4> clip_{};
    double shift_x_ = 0, shift_y_ = 0;
};
vtkStandardNewMacro(CanvasDevice);

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

void paint(const Chart& given, Canvas& canvas, double x, double y, int width, int height) {
    vtkNew<vtkContextScene> scene;
    scene->SetGeometry(width, height);
    vtkNew<vtkChartXY> chart;
    scene->AddItem(chart);
    chart->SetTitle(given.title);
    chart->GetTitleProperties()->SetFontSize(16);
    chart->GetTitleProperties()->SetBold(1);
    chart->GetTitleProperties()->SetColor(0.1, 0.1, 0.1);
    const auto shown_at = [&](double vx, double vy) {
        return std::isfinite(vx) && std::isfinite(vy) && !(given.x_log && vx <= 0) &&
               !(given.y_log && vy <= 0);
    };
    // The axes come first: a plot takes its logarithms once.
    Range rx, ry;
    for (const Series& s : given.series) {
        if (s.look == SeriesLook::bars && !given.y_log) ry.include(0);
        for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
            if (!shown_at(s.x[i], s.y[i])) continue;
            rx.include(s.x[i]);
            ry.include(s.y[i]);
        }
    }
    const auto pad = [](Range& r, bool log_scale) {
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
    };
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
    set_axis(chart->GetAxis(vtkAxis::BOTTOM), given.x_label, rx, given.x_log);
    set_axis(chart->GetAxis(vtkAxis::LEFT), given.y_label, ry, given.y_log);
    chart->GetAxis(vtkAxis::BOTTOM)->Update();
    chart->GetAxis(vtkAxis::LEFT)->Update();
    bool named = false;
    for (std::size_t number = 0; number < given.series.size(); ++number) {
        const Series& s = given.series[number];
        vtkNew<vtkTable> table;
        vtkNew<vtkDoubleArray> ax, ay;
        ax->SetName("x");
        ay->SetName(s.name.empty() ? "y" : s.name.c_str());
        for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
            if (!shown_at(s.x[i], s.y[i])) continue;
            ax->InsertNextValue(s.x[i]);
            ay->InsertNextValue(s.y[i]);
        }
        if (ax->GetNumberOfValues() == 0) continue;
        // One point alone is not drawn: it is given twice.
        if (ax->GetNumberOfValues() == 1) {
            ax->InsertNextValue(ax->GetValue(0));
            ay->InsertNextValue(ay->GetValue(0));
        }
        table->AddColumn(ax);
        table->AddColumn(ay);
        const bool own = s.colour != std::array<std::uint8_t, 3>{0, 0, 0};
        const auto colour = own ? s.colour : kPalette[number % kPalette.size()];
        const auto add = [&](int kind, double size) {
            vtkPlot* plot = chart->AddPlot(kind);
            plot->SetInputData(table, 0, 1);
            plot->SetColor(colour[0], colour[1], colour[2], 255);
            plot->SetWidth(static_cast<float>(size));
            return plot;
        };
        const SeriesLook look = s.look;
        vtkPlot* shown = nullptr;
        if (look == SeriesLook::bars) {
            shown = add(vtkChart::BAR, s.width_px);
        } else if (look == SeriesLook::line || look == SeriesLook::dashed ||
                   look == SeriesLook::line_and_points) {
            shown = add(vtkChart::LINE, s.width_px);
            shown->GetPen()->SetLineType(look == SeriesLook::dashed ? vtkPen::DASH_LINE
                                                                    : vtkPen::SOLID_LINE);
        }
        if (!shown || look == SeriesLook::line_and_points) {
            const double size = shown ? 7 : 3 * s.width_px;
            if (shown || look != SeriesLook::bars) {
                auto* points = vtkPlotPoints::SafeDownCast(add(vtkChart::POINTS, size));
                points->SetMarkerStyle(look == SeriesLook::crosses    ? vtkPlotPoints::CROSS
                                       : look == SeriesLook::diamonds ? vtkPlotPoints::DIAMOND
                                                                      : vtkPlotPoints::CIRCLE);
                points->SetMarkerSize(static_cast<float>(size));
                if (shown) points->SetLegendVisibility(false);
                if (!shown) shown = points;
            }
        }
        shown->SetLegendVisibility(!s.name.empty());
        named = named || !s.name.empty();
    }
    chart->SetShowLegend(named);
    int entries = 0;
    for (const Series& s : given.series) entries += !s.name.empty();
    // A long legend would hide the plot: it goes beside it.
    chart->GetLegend()->SetInline(entries < 5);
    chart->GetLegend()->GetPen()->SetColor(200, 200, 200);
    chart->GetLegend()->SetLabelSize(12);
    chart->SetRenderEmpty(true);
    if (!given.picture.empty()) {
        for (const int axis : {vtkAxis::LEFT, vtkAxis::BOTTOM, vtkAxis::RIGHT, vtkAxis::TOP})
            chart->GetAxis(axis)->SetVisible(false);
    }

    vtkNew<CanvasDevice> device;
    device->size(width, height);
    device->SetViewportSize(vtkVector2i(width, height));
    device->SetViewportRect(vtkRecti(0, 0, width, height));
    // The first painting settles the layout: its axes still have the length of the whole chart.
    Canvas draft(width, height);
    for (const bool last : {false, true}) {
        device->open(last ? &canvas : &draft);
        device->shift(last ? x : 0, last ? y : 0);
        vtkNew<vtkContext2D> context;
        context->Begin(device);
        scene->Paint(context);
        context->End();
    }
    canvas.clip();
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
    vtkNew<vtkImageData> image;
    image->SetDimensions(canvas.width(), canvas.height(), 1);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
    auto* to = static_cast<std::uint8_t*>(image->GetScalarPointer());
    const auto row = static_cast<std::size_t>(3 * canvas.width());
    for (int j = 0; j < canvas.height(); ++j) {
        std::copy_n(canvas.rgb().data() + static_cast<std::size_t>(canvas.height() - 1 - j) * row,
                    row, to + static_cast<std::size_t>(j) * row);
    }
    vtkNew<vtkPNGWriter> writer;
    writer->WriteToMemoryOn();
    writer->SetInputData(image);
    writer->Write();
    vtkUnsignedCharArray* png = writer->GetResult();
    return write_file(
        path, std::span<const std::uint8_t>(png->GetPointer(0),
                                            static_cast<std::size_t>(png->GetNumberOfValues())));
}

Status write_chart_svg(const ChartSheet& sheet, const std::string& path) {
    return write_file(path, std::string_view(painted(sheet).svg()));
}

}  // namespace sonocase::pipeline
