// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/canvas_device.h"

#include <vtkBrush.h>
#include <vtkContext2D.h>
#include <vtkContextDevice2D.h>
#include <vtkContextScene.h>
#include <vtkImageData.h>
#include <vtkMatrix3x3.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkPen.h>
#include <vtkPlotPoints.h>
#include <vtkSmartPointer.h>
#include <vtkTextProperty.h>
#include <vtkUnicodeString.h>

#include <array>
#include <vector>

#include "pipeline/pictures/chart_text.h"

namespace sonocase::pipeline {
namespace {

// Draws on a canvas what VTK's 2-D context asks for.
class CanvasDevice : public vtkContextDevice2D {
  public:
    static CanvasDevice* New();
    vtkTypeMacro(CanvasDevice, vtkContextDevice2D);

    void open(Canvas* canvas) { canvas_ = canvas; }
    // Moves everything drawn later to the right and up.
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
                case vtkPlotPoints::SQUARE: canvas_->fill(box, colour); break;
                case vtkPlotPoints::DIAMOND: canvas_->fill(rhomb, colour); break;
                default: canvas_->disc(c, r, colour);
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
        draw_text(*canvas_, *TextProp, string, points(point, 1)[0]);
    }
    void ComputeStringBounds(const vtkStdString& string, float bounds[4]) override {
        const TextBox box = text_box(*TextProp, string);
        bounds[0] = static_cast<float>(box.left);
        bounds[1] = static_cast<float>(box.bottom);
        bounds[2] = static_cast<float>(box.width);
        bounds[3] = static_cast<float>(box.height);
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

}  // namespace

void paint_scene(vtkContextScene& scene, Canvas& canvas, const SceneArea& area) {
    vtkNew<CanvasDevice> device;
    device->size(area.width_px, area.height_px);
    device->SetViewportSize(vtkVector2i(area.width_px, area.height_px));
    device->SetViewportRect(vtkRecti(0, 0, area.width_px, area.height_px));
    // The first painting settles the layout: its axes still have the length of the whole chart.
    Canvas draft(area.width_px, area.height_px);
    for (const bool last : {false, true}) {
        device->open(last ? &canvas : &draft);
        device->shift(last ? area.left_px : 0, last ? area.bottom_px : 0);
        vtkNew<vtkContext2D> context;
        context->Begin(device);
        scene.Paint(context);
        context->End();
    }
    canvas.clip();
}

}  // namespace sonocase::pipeline
