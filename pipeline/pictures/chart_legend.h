// SPDX-License-Identifier: Apache-2.0

// The legend of a chart: a frame that fits its words, one entry per line, symbols left of the
// words. Internal to pipeline/pictures.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/pictures/canvas.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline::inline pictures {

struct LegendItem {
    std::string name;
    SeriesStyle style = SeriesStyle::line;
    CanvasColour colour{0, 0, 0, 255};
    double width_px = 2;  // as in Series
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

// Measures the words. The frame is at most max_width_px wide (at least 80); longer names are
// shortened.
Legend lay_out_legend(std::span<const LegendItem> items, double max_width_px);

// The frame, filled with white, and the entries; `corner` is the frame's lower left corner.
void draw_legend(Canvas& canvas, const Legend& legend, CanvasPoint corner);

// The mark of a point of a series: a cross, a diamond or a disc.
void draw_mark(Canvas& canvas, const LegendItem& item, CanvasPoint centre, double radius_px);

}  // namespace sonocase::pipeline::inline pictures
