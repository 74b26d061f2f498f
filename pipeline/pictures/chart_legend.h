// SPDX-License-Identifier: Apache-2.0

// The legend of a chart: a frame that fits its words, one entry per line, symbols left of the
// words. Internal to pipeline/pictures.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/pictures/canvas.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline {

struct LegendItem {
    std::string name;
    SeriesLook look = SeriesLook::line;
    CanvasColour colour{0, 0, 0, 255};
    double width_px = 2;  // of the line, or of the mark
};

// Pixels, y up, relative to the lower left corner of the legend's frame.
struct LegendBox {
    double left = 0, bottom = 0, width = 0, height = 0;
};

struct LegendEntry {
    LegendItem item;  // its name shortened with an ellipsis if it is too long
    LegendBox symbol, words;
};

struct Legend {
    double width = 0, height = 0;      // of the frame; zero without entries
    std::vector<LegendEntry> entries;  // from the top down
};

// Measures the words. The frame is at most most_width_px wide (at least 80); longer names are
// shortened.
Legend lay_out_legend(std::span<const LegendItem> items, double most_width_px);

// The frame, filled with white, and the entries; `corner` is the frame's lower left corner.
void draw_legend(Canvas& canvas, const Legend& legend, CanvasPoint corner);

}  // namespace sonocase::pipeline
