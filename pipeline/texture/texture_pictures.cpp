// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/texture_pictures.h"

#include <algorithm>
#include <cmath>

#include "formats/base/geometry.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/chart.h"
#include "pipeline/texture/spectrum/local_trend.h"

namespace sonocase::pipeline {
namespace {

constexpr int kShownPx = 160;  // width and height of each picture, example pixels

std::uint8_t byte_of(double grey) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0l, 255l));
}

Chart example_panel(const ExampleImage& example) {
    Chart panel;
    panel.title = "example: " + example.name;
    panel.picture_width = panel.picture_height = kShownPx;
    panel.picture.assign(kShownPx * kShownPx, 255);
    for (int y = 0; y < std::min(example.height, kShownPx); ++y) {
        for (int x = 0; x < std::min(example.width, kShownPx); ++x) {
            const std::size_t i = example.index(x, y);
            panel.picture[static_cast<std::size_t>(x + kShownPx * y)] =
                example.used(i) ? byte_of(example.grey[i]) : 255;
        }
    }
    return panel;
}

// Cut along two unit vectors, one step per pixel of the example, by the nearest voxel as in the
// image model "paper".
Chart cut_panel(const char* title, const SolidTextureResult& made, Vector3 right, Vector3 down) {
    const int n = made.texture.edge;
    Chart panel;
    panel.title = title;
    panel.picture_width = panel.picture_height = kShownPx;
    panel.picture.resize(kShownPx * kShownPx);
    const double step = 1.0 / made.pixels_per_voxel;
    const auto wrap = [n](double v) {
        const auto i = static_cast<int>(std::floor(v + 0.5));
        return static_cast<std::size_t>(((i % n) + n) % n);
    };
    for (int y = 0; y < kShownPx; ++y) {
        for (int x = 0; x < kShownPx; ++x) {
            const Vector3 p = Vector3{0, 0, n / 3.0} + (x * step) * right + (y * step) * down;
            const auto e = static_cast<std::size_t>(n);
            const std::uint8_t v = made.texture.voxels[wrap(p.x) + e * (wrap(p.y) + e * wrap(p.z))];
            panel.picture[static_cast<std::size_t>(x + kShownPx * y)] =
                byte_of(made.grey_mean + (v - 128) / 32.0 * made.grey_sd);
        }
    }
    return panel;
}

Series histogram(const std::string& name, const std::vector<float>& grey) {
    Series series;
    series.name = name;
    std::vector<double> bins(64, 0);
    for (const float g : grey) {
        bins[static_cast<std::size_t>(std::clamp(static_cast<int>(g / 4), 0, 63))] +=
            25.0 / static_cast<double>(grey.size());
    }
    for (std::size_t b = 0; b < bins.size(); ++b) {
        series.x.push_back(4 * static_cast<double>(b) + 2);
        series.y.push_back(bins[b]);
    }
    return series;
}

Series profile(const std::string& name, const Autocorrelation& a, double angle, double scale) {
    Series series;
    series.name = name;
    for (double r = 0; r <= a.reach && r * scale <= 48; r += 0.25) {
        series.x.push_back(r * scale);
        series.y.push_back(a.between(r * std::cos(angle), r * std::sin(angle)));
    }
    return series;
}

// Autocorrelation of example and texture along and across the main direction.
void add_profiles(const TextureAssessment& assessment,
                  const std::vector<float>& grey,
                  ChartSheet* sheet) {
    const SolidTextureResult& made = assessment.made;
    const ExampleImage local = without_local_trend(assessment.example, kGrainTrendPx);
    const Autocorrelation wanted = autocorrelation({&local, 1}, 48);
    const Autocorrelation got = plane_autocorrelation(
        without_local_trend(grey, made.texture.edge, kGrainTrendPx / made.pixels_per_voxel),
        made.texture.edge, made.texture.edge / 2);
    for (const bool along : {true, false}) {
        const double angle =
            assessment.quality.example.angle_rad + (along ? 0 : 1.5707963267948966);
        Chart chart;
        const CorrelationWidths& e = assessment.quality.example;
        const CorrelationWidths& t = assessment.quality.texture;
        chart.title = std::string(along ? "along: " : "across: ") +
                      number_text(along ? t.along : t.across, 3) + " px, example " +
                      number_text(along ? e.along : e.across, 3);
        chart.x_label = "lag, example px";
        chart.y_label = "autocorrelation";
        chart.series = {profile("example", wanted, angle, 1),
                        profile("texture", got, angle, made.pixels_per_voxel)};
        sheet->charts.push_back(chart);
    }
}

}  // namespace

Status write_texture_page(const TextureAssessment& assessment, const std::string& path) {
    const SolidTextureResult& made = assessment.made;
    const ExampleImage& example = assessment.example;
    const std::vector<float> grey = texture_grey(made.texture, made.grey_mean, made.grey_sd);
    ChartSheet sheet;
    sheet.columns = 4;
    sheet.width_px = 360;
    sheet.height_px = 390;
    sheet.charts = {example_panel(example), cut_panel("cut x-y", made, {1, 0, 0}, {0, 1, 0}),
                    cut_panel("cut x-z", made, {1, 0, 0}, {0, 0, 1}),
                    cut_panel("cut z-y", made, {0, 0, 1}, {0, 1, 0}),
                    cut_panel("oblique cut", made, {0.80, 0.36, 0.48}, {-0.60, 0.48, 0.64})};
    Chart greys;
    greys.title = "grey: KS " + number_text(assessment.quality.distance.ks, 2) +
                  ", between halves " + number_text(assessment.quality.floor.ks, 2);
    greys.x_label = "grey";
    greys.y_label = "per cent per level";
    greys.series = {histogram("example", used_grey(example)), histogram("texture", grey)};
    sheet.charts.push_back(greys);

    add_profiles(assessment, grey, &sheet);
    return write_chart_png(sheet, path);
}

}  // namespace sonocase::pipeline
