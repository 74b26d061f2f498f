// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/texture_quality.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/base/geometry.h"
#include "formats/text/number_text.h"
#include "pipeline/base/periodic_volume.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/pictures/chart.h"
#include "pipeline/texture/autocorrelation.h"
#include "pipeline/texture/example_image.h"

namespace sonocase::pipeline::inline texture {

namespace {

// RMS difference over the lags within the wider of the two grains, at most the common reach.
double grain_distance(const Autocorrelation& a, const Autocorrelation& b) {
    const double radius = std::max(correlation_widths(through_window(a, b)).along,
                                   correlation_widths(through_window(b, b)).along);
    const int reach = std::min({a.reach, b.reach, static_cast<int>(std::ceil(radius))});
    double sum = 0, count = 0;
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            if (x * x + y * y > radius * radius) continue;
            sum += (a.at(x, y) - b.at(x, y)) * (a.at(x, y) - b.at(x, y));
            count += 1;
        }
    }
    return std::sqrt(sum / count);
}

constexpr TextureDistance kMaxDistance{1, 255, 1};
constexpr int kReach = 32;       // px, of the grain distance
constexpr int kWidthReach = 96;  // px, of the correlation widths

Autocorrelation grain_of(const ExampleImage& image, int reach) {
    const ExampleImage local = without_local_trend(image, kGrainTrendPx);
    return autocorrelation({&local, 1}, reach);
}

Autocorrelation grain_of(std::span<const float> grey, const SolidTextureResult& made) {
    const int edge = made.texture.edge;
    return plane_autocorrelation(
        without_local_trend(grey, edge, kGrainTrendPx / made.pixels_per_voxel), edge, edge / 2);
}

}  // namespace

double kolmogorov_smirnov(std::span<const float> a, std::span<const float> b) {
    std::vector<float> x(a.begin(), a.end()), y(b.begin(), b.end());
    std::sort(x.begin(), x.end());
    std::sort(y.begin(), y.end());
    double worst = 0;
    for (std::size_t i = 0, j = 0; i < x.size() && j < y.size();) {
        const float v = std::min(x[i], y[j]);
        while (i < x.size() && x[i] <= v) ++i;
        while (j < y.size() && y[j] <= v) ++j;
        worst = std::max(worst, std::abs(static_cast<double>(i) / static_cast<double>(x.size()) -
                                         static_cast<double>(j) / static_cast<double>(y.size())));
    }
    return worst;
}

double earth_mover(std::span<const float> a, std::span<const float> b) {
    std::vector<float> x(a.begin(), a.end()), y(b.begin(), b.end());
    std::sort(x.begin(), x.end());
    std::sort(y.begin(), y.end());
    // The area between the two distribution functions.
    double area = 0, before = std::min(x[0], y[0]);
    std::size_t i = 0, j = 0;
    while (i < x.size() || j < y.size()) {
        const double v = i == x.size() ? y[j] : j == y.size() ? x[i] : std::min(x[i], y[j]);
        const double gap = std::abs(static_cast<double>(i) / static_cast<double>(x.size()) -
                                    static_cast<double>(j) / static_cast<double>(y.size()));
        area += gap * (v - before);
        before = v;
        while (i < x.size() && x[i] <= v) ++i;
        while (j < y.size() && y[j] <= v) ++j;
    }
    return area;
}

std::array<double, 3> seam_scores(const SolidTexture& texture) {
    const std::size_t n = texture.edge;
    std::array<double, 3> scores{};
    for (int axis = 0; axis < 3; ++axis) {
        const std::vector<double> step =
            steps_between_planes<std::uint8_t>(texture.voxels, texture.edge, axis);
        double mean = 0, square = 0;
        const auto inner = static_cast<double>(n - 1);
        for (std::size_t p = 0; p + 1 < n; ++p) mean += step[p] / inner;
        for (std::size_t p = 0; p + 1 < n; ++p)
            square += (step[p] - mean) * (step[p] - mean) / inner;
        scores[axis] = square > 0 ? (step[n - 1] - mean) / std::sqrt(square) : 0;
    }
    return scores;
}

std::vector<float> texture_grey(const SolidTexture& texture, double mean, double sd) {
    std::vector<float> out(texture.voxels.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
        out[i] = static_cast<float>(
            std::clamp(mean + (texture.voxels[i] - 128) / 32.0 * sd, 0.0, 255.0));
    }
    return out;
}

std::array<ExampleImage, 2> split_example(const ExampleImage& example) {
    const bool across_x = example.width >= example.height;
    std::array<ExampleImage, 2> halves;
    for (int h = 0; h < 2; ++h) {
        ExampleImage& half = halves[h];
        half.name = example.name + (h == 0 ? ", first half" : ", second half");
        half.width = across_x ? example.width / 2 : example.width;
        half.height = across_x ? example.height : example.height / 2;
        const int x0 = across_x ? h * half.width : 0, y0 = across_x ? 0 : h * half.height;
        half.grey.resize(half.count());
        half.use.resize(half.count());
        for (int y = 0; y < half.height; ++y) {
            for (int x = 0; x < half.width; ++x) {
                const std::size_t from = example.index(x0 + x, y0 + y);
                half.grey[half.index(x, y)] = example.grey[from];
                half.use[half.index(x, y)] = example.used(from);
            }
        }
    }
    return halves;
}

TextureDistance distance_between(const ExampleImage& a, const ExampleImage& b) {
    const std::vector<float> x = used_grey(a), y = used_grey(b);
    if (x.empty() || y.empty()) return kMaxDistance;
    return {kolmogorov_smirnov(x, y), earth_mover(x, y),
            grain_distance(grain_of(a, kReach), grain_of(b, kReach))};
}

TextureDistance distance_between(const SolidTextureResult& made, const ExampleImage& example) {
    const std::vector<float> x = texture_grey(made.texture, made.grey_mean, made.grey_sd);
    const std::vector<float> y = used_grey(example);
    if (y.empty()) return kMaxDistance;
    return {kolmogorov_smirnov(x, y), earth_mover(x, y),
            grain_distance(grain_of(x, made),
                           at_stride(grain_of(example, kReach), made.pixels_per_voxel))};
}

TextureQuality measure_texture(const SolidTextureResult& made, const ExampleImage& example) {
    TextureQuality q;
    q.distance = distance_between(made, example);
    const std::array<ExampleImage, 2> halves = split_example(example);
    q.floor = distance_between(halves[0], halves[1]);
    const std::vector<float> grey = texture_grey(made.texture, made.grey_mean, made.grey_sd);
    const Autocorrelation grain = grain_of(example, kWidthReach);
    // Both are measured on the lattice of the texture, such that interpolation between lags affects
    // both alike.
    const Autocorrelation seen = at_stride(grain, made.pixels_per_voxel);
    q.example = correlation_widths(through_window(seen, seen));
    q.texture = correlation_widths(through_window(grain_of(grey, made), seen));
    q.example.along *= made.pixels_per_voxel;
    q.example.across *= made.pixels_per_voxel;
    q.texture.along *= made.pixels_per_voxel;
    q.texture.across *= made.pixels_per_voxel;
    double sum = 0, square = 0;
    for (const float g : grey) sum += g, square += static_cast<double>(g) * g;
    sum /= static_cast<double>(grey.size());
    square /= static_cast<double>(grey.size());
    q.texture_contrast = sum > 0 ? std::sqrt(std::max(square - sum * sum, 0.0)) / sum : 0;
    q.example_contrast = made.grey_mean > 0 ? made.grey_sd / made.grey_mean : 0;
    for (const double z : seam_scores(made.texture)) {
        q.seam_score = std::max(q.seam_score, std::abs(z));
    }
    return q;
}

std::vector<Measure> TextureAssessment::measures() const {
    const std::string n = made.texture.name + ".";
    std::vector<Measure> out = {{n + "ks", quality.distance.ks},
                                {n + "ks_floor", quality.floor.ks},
                                {n + "earth_mover_grey", quality.distance.earth_mover_grey},
                                {n + "earth_mover_floor_grey", quality.floor.earth_mover_grey},
                                {n + "grain", quality.distance.grain},
                                {n + "grain_floor", quality.floor.grain},
                                {n + "along_px", quality.texture.along},
                                {n + "along_example_px", quality.example.along},
                                {n + "across_px", quality.texture.across},
                                {n + "across_example_px", quality.example.across},
                                {n + "anisotropy", quality.texture.ratio()},
                                {n + "anisotropy_example", quality.example.ratio()},
                                {n + "contrast", quality.texture_contrast},
                                {n + "contrast_example", quality.example_contrast},
                                {n + "seam_score", quality.seam_score}};
    if (has_held_back) {
        out.push_back({n + "held_back_ks", held_back.ks});
        out.push_back({n + "held_back_earth_mover_grey", held_back.earth_mover_grey});
        out.push_back({n + "held_back_grain", held_back.grain});
    }
    out.push_back({n + "pixels_per_voxel", static_cast<double>(made.pixels_per_voxel)});
    out.push_back({n + "seconds", seconds});
    return out;
}

Result<TextureAssessment> assess_texture(const TextureSpec& spec) {
    TextureAssessment out;
    const Stopwatch watch;
    SONOCASE_TRY(auto made, make_solid_texture(spec));
    out.seconds = watch.seconds();
    out.made = std::move(made);
    const auto largest = std::max_element(
        spec.examples.begin(), spec.examples.end(),
        [](const ExampleImage& a, const ExampleImage& b) { return a.count() < b.count(); });
    SONOCASE_TRY(auto prepared, prepare_example(*largest));
    out.example = std::move(prepared.image);
    out.quality = measure_texture(out.made, out.example);
    const std::array<ExampleImage, 2> halves = split_example(out.example);
    TextureSpec half = spec;
    half.examples = {halves[0]};
    if (auto from_half = make_solid_texture(half)) {
        out.has_held_back = true;
        out.held_back = distance_between(*from_half, halves[1]);
    }
    return out;
}

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
            panel.picture[x + kShownPx * y] = example.used(i) ? byte_of(example.grey[i]) : 255;
        }
    }
    return panel;
}

// Cuts the texture along two unit vectors, one step per pixel of the example, by the nearest voxel
// as in the image model "paper".
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
            const std::size_t e = n;
            const std::uint8_t v = made.texture.voxels[wrap(p.x) + e * (wrap(p.y) + e * wrap(p.z))];
            panel.picture[x + kShownPx * y] =
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
        bins[std::clamp(static_cast<int>(g / 4), 0, 63)] += 25.0 / static_cast<double>(grey.size());
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

}  // namespace sonocase::pipeline::inline texture
