// SPDX-License-Identifier: Apache-2.0

// Words of a chart, drawn and measured by FreeType through VTK: the same pixels on every machine,
// without a display.
#pragma once

#include <string>

#include "pipeline/pictures/canvas.h"

class vtkTextProperty;

namespace sonocase::pipeline {

// The pixels that a text covers, relative to its anchor; y up.
struct TextBox {
    int left = 0, bottom = 0;
    int width = 1, height = 1;
};

// Font, size, colour, justification and orientation are those of the style.
void draw_text(Canvas& canvas, vtkTextProperty& style, const std::string& string, CanvasPoint at);
TextBox text_box(vtkTextProperty& style, const std::string& string);

}  // namespace sonocase::pipeline
