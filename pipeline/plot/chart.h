// Charts as files: VTK lays them out, a software canvas draws them, so that no display is needed.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/result.h"

namespace sonocase::pipeline {

struct ChartSeries {
    std::string name;          // in the legend; empty: not there
    std::vector<double> x, y;  // same length; not finite: left out
    std::array<std::uint8_t, 3> colour{31, 119, 180};
    double line_px = 0;    // 0: no line
    double marker_px = 0;  // 0: no markers
    enum class Marker { circle, cross, plus, square, diamond } marker = Marker::circle;
    bool dashed = false;
};

struct Chart {
    std::string title, x_title, y_title;
    bool log_x = false, log_y = false;  // values <= 0 are left out
    bool equal_axes = false;            // one unit is as long in x as in y
    std::vector<ChartSeries> series;
};

// Draws the charts side by side, `columns` in a row, each width_px x height_px. The form follows
// the ending of each path, .png or .svg; both are drawn at once.
Status draw_charts(std::span<const Chart> charts,
                   int columns,
                   int width_px,
                   int height_px,
                   std::span<const std::string> paths);

}  // namespace sonocase::pipeline
