// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart_text.h"

#include <vtkAutoInit.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkStdString.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>

#include <cmath>
#include <vector>

// VTK finds its text renderer through an object factory.
VTK_MODULE_INIT(vtkRenderingFreeType)

namespace sonocase::pipeline {
namespace {

constexpr int kDpi = 72;

}  // namespace

void draw_text(Canvas& canvas, vtkTextProperty& style, const std::string& string, CanvasPoint at) {
    if (string.empty()) return;
    vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
    vtkNew<vtkTextProperty> prop;
    prop->ShallowCopy(&style);
    vtkNew<vtkImageData> image;
    int used[2] = {0, 0};
    if (!renderer || !renderer->RenderString(prop, vtkStdString(string), image, used, kDpi)) {
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
    double rgb[3];
    prop->GetColor(rgb);
    const auto level = [](double v) { return static_cast<std::uint8_t>(std::lround(255 * v)); };
    // The SVG anchors text at its base line, found from the vertical justification.
    Canvas::Text text;
    text.text = string;
    text.degrees = prop->GetOrientation();
    text.size_px = prop->GetFontSize();
    text.bold = prop->GetBold() != 0;
    const int across = prop->GetJustification();
    text.anchor = across == VTK_TEXT_LEFT ? "start" : across == VTK_TEXT_RIGHT ? "end" : "middle";
    const int up = prop->GetVerticalJustification();
    const double drop = up == VTK_TEXT_TOP ? -0.8 : up == VTK_TEXT_CENTERED ? -0.35 : 0.0;
    const double turn = text.degrees * 3.14159265358979323846 / 180;
    text.at = {at.x - std::sin(turn) * drop * text.size_px,
               at.y + std::cos(turn) * drop * text.size_px};
    canvas.text(mask, across_px, up_px, static_cast<int>(std::lround(at.x)) + e[0],
                static_cast<int>(std::lround(at.y)) + e[2],
                {level(rgb[0]), level(rgb[1]), level(rgb[2]), 255}, text);
}

TextBox text_box(vtkTextProperty& style, const std::string& string) {
    int box[4] = {0, 0, 0, 0};
    vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
    if (renderer) renderer->GetBoundingBox(&style, vtkStdString(string), box, kDpi);
    return {box[0], box[2], box[1] - box[0] + 1, box[3] - box[2] + 1};
}

}  // namespace sonocase::pipeline
