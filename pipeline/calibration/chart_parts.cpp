// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/chart_parts.h"

#include <algorithm>
#include <filesystem>

namespace sonocase::pipeline {

Status draw(std::span<const Chart> charts,
            int columns,
            const std::string& folder,
            const std::string& name) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    const ChartSheet sheet{{charts.begin(), charts.end()}, columns, 560, 420};
    if (Status s = write_chart_png(sheet, folder + "/" + name + ".png"); !s) return s;
    return write_chart_svg(sheet, folder + "/" + name + ".svg");
}

Series marks(const std::string& name, ChartColour colour, double size) {
    Series s;
    s.name = name;
    s.colour = colour;
    s.look = SeriesLook::points;
    s.width_px = size / 3;
    return s;
}

Series stroke(const std::string& name, ChartColour colour, double width) {
    Series s;
    s.name = name;
    s.colour = colour;
    s.width_px = width;
    return s;
}

Chart residual_chart(std::span<const PoseResidual> residuals,
                     const std::string& title,
                     double rms_mm) {
    Chart chart{title, "reading", "residual [mm]", false, false, {}, false};
    Series used = marks("used", kUsed, 4), out = marks("left out", kLeftOut, 6);
    out.look = SeriesLook::crosses;
    // Outliers are far away: they are shown at the upper edge.
    const double edge = std::max(8 * rms_mm, 1e-6);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
        Series& s = residuals[i].inlier ? used : out;
        s.x.push_back(static_cast<double>(i));
        s.y.push_back(std::min(residuals[i].residual_mm, edge));
    }
    Series level = stroke("rms of those used", kGuide, 1);
    level.look = SeriesLook::dashed;
    level.x = {0, static_cast<double>(residuals.size())};
    level.y = {rms_mm, rms_mm};
    chart.series = {used, out, level};
    if (out.x.empty()) chart.series.erase(chart.series.begin() + 1);
    return chart;
}

}  // namespace sonocase::pipeline
