// SPDX-License-Identifier: Apache-2.0

// Plots for the reports: axes with round ticks, linear or logarithmic, lines, marks, bars and a
// legend, drawn on a canvas. No display is needed, and the bytes are the same on every machine. No
// text lies on another: ticks are thinned until their labels fit, titles that are too long are set
// smaller, and a legend moves to a free corner or out of the plot.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline pictures {

enum class SeriesStyle { line, points, line_and_points, bars, dashed, crosses, diamonds };

struct Series {
    std::string name;       // in the legend; empty: not shown there
    std::vector<double> x;  // # y; pairs that are not finite are left out
    std::vector<double> y;
    SeriesStyle style = SeriesStyle::line;
    std::array<std::uint8_t, 3> colour{0, 0, 0};  // all zero: the next of a palette
    double width_px = 2;  // of the line; a third of the width of a mark; bars need none
};

struct Chart {
    std::string title;
    std::string x_label;  // with its unit: "seconds"
    std::string y_label;
    bool x_log = false;  // values <= 0 are left out
    bool y_log = false;
    std::vector<Series> series;
    // One below the other stand things, each with its name, a bar and its value: a series of bars
    // for each. Other series mark rows: x is the number of the row, from 1, y the value.
    bool rows = false;
    bool equal_axes = false;  // one unit has the same length in x and in y
    // A grey picture instead of the plot, below the title: rows from the top down, enlarged by a
    // whole factor to fill the cell.
    std::vector<std::uint8_t> picture{};  // # picture_width * picture_height; empty: none
    int picture_width = 0;
    int picture_height = 0;
};

// Charts side by side, row by row, `columns` to a row; each cell is width_px x height_px.
struct ChartSheet {
    std::vector<Chart> charts;
    int columns = 1;
    int width_px = 720;
    int height_px = 480;
};

// Written under a temporary name and renamed. Error: the file cannot be written. Cost: about 10 ms
// per chart.
Status write_chart_png(const ChartSheet& sheet, const std::string& path);
std::string chart_svg(const ChartSheet& sheet);
Status write_chart_svg(const ChartSheet& sheet, const std::string& path);

}  // namespace sonocase::pipeline::inline pictures
