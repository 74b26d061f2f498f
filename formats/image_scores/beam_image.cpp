// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/beam_image.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sonocase {
namespace {

// Interpolates between four neighbours; beyond the edge the nearest ones count.
template <class At>
double bilinear(double x, double y, int width, int height, const At& at) {
    x = std::clamp(x, 0.0, width - 1.0);
    y = std::clamp(y, 0.0, height - 1.0);
    const int i = std::min(static_cast<int>(x), std::max(width - 2, 0)),
              j = std::min(static_cast<int>(y), std::max(height - 2, 0));
    const int i1 = std::min(i + 1, width - 1), j1 = std::min(j + 1, height - 1);
    const double u = x - i, v = y - j;
    return (1 - v) * ((1 - u) * at(i, j) + u * at(i1, j)) +
           v * ((1 - u) * at(i, j1) + u * at(i1, j1));
}

}  // namespace

BeamImage beam_grid(const ScanPlace& place, int lines, double sample_mm) {
    assert(lines > 0 && place.depth_mm > 0 && place.mm_per_px > 0);
    BeamImage grid;
    grid.fan = place.fan();
    grid.lines = lines;
    grid.sample_mm = sample_mm > 0 ? sample_mm : grid.fan ? kFanSampleMm : kLinearSampleMm;
    grid.samples = std::max(1, static_cast<int>(place.depth_mm / grid.sample_mm));
    grid.radius_mm = place.radius_mm;
    grid.line_step = (grid.fan ? 2 * place.half_angle_rad : place.width_mm) / lines;
    return grid;
}

PixelPoint pixel_of(const ScanPlace& place, const BeamImage& grid, double sample, double line) {
    const double depth_px = (sample + 0.5) * grid.sample_mm / place.mm_per_px;
    const double across = (line + 0.5) * grid.line_step;
    if (!grid.fan) {
        return {place.apex_x_px + (across - place.width_mm / 2) / place.mm_per_px,
                place.apex_y_px + depth_px};
    }
    const double angle = across - place.half_angle_rad;
    const double r = place.radius_mm / place.mm_per_px + depth_px;
    return {place.apex_x_px + std::sin(angle) * r, place.apex_y_px + std::cos(angle) * r};
}

BeamPoint beam_of(const ScanPlace& place, const BeamImage& grid, PixelPoint pixel) {
    const double dx = (pixel.x_px - place.apex_x_px) * place.mm_per_px,
                 dy = (pixel.y_px - place.apex_y_px) * place.mm_per_px;
    const double across = grid.fan ? std::atan2(dx, dy) : dx;
    const double depth = grid.fan ? std::hypot(dx, dy) - grid.radius_mm : dy;
    const double middle = 0.5 * grid.lines * grid.line_step;
    return {depth / grid.sample_mm - 0.5, (across + middle) / grid.line_step - 0.5};
}

bool in_grid(const BeamImage& grid, BeamPoint p) {
    return p.line >= -0.5 && p.line <= grid.lines - 0.5 && p.sample >= -0.5 &&
           p.sample <= grid.samples - 0.5;
}

double grey_at(const BeamImage& image, BeamPoint p) {
    return bilinear(p.line, p.sample, image.lines, image.samples,
                    [&](int l, int k) { return static_cast<double>(image.at(k, l)); });
}

BeamImage beam_from_picture(std::span<const std::uint8_t> pixels,
                            int width_px,
                            int height_px,
                            const ScanPlace& place,
                            int lines,
                            double sample_mm) {
    assert(pixels.size() ==
           static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px));
    BeamImage image = beam_grid(place, lines, sample_mm);
    image.grey.resize(static_cast<std::size_t>(image.samples) * static_cast<std::size_t>(lines));
    const auto at = [&](int x, int y) {
        return static_cast<double>(
            pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                   static_cast<std::size_t>(x)]);
    };
    for (int l = 0; l < lines; ++l) {
        const PixelPoint first = pixel_of(place, image, 0, l), next = pixel_of(place, image, 1, l);
        for (int k = 0; k < image.samples; ++k) {
            const double x = first.x_px + k * (next.x_px - first.x_px),
                         y = first.y_px + k * (next.y_px - first.y_px);
            image.grey[image.index(k, l)] =
                static_cast<float>(bilinear(x, y, width_px, height_px, at));
        }
    }
    return image;
}

std::vector<std::uint8_t> picture_from_beam(const BeamImage& image,
                                            const ScanPlace& place,
                                            int width_px,
                                            int height_px,
                                            std::uint8_t outside) {
    std::vector<std::uint8_t> pixels(
        static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px), outside);
    for (int y = 0; y < height_px; ++y) {
        for (int x = 0; x < width_px; ++x) {
            const BeamPoint point =
                beam_of(place, image, {static_cast<double>(x), static_cast<double>(y)});
            if (!in_grid(image, point)) continue;
            const double grey = grey_at(image, point);
            pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                   static_cast<std::size_t>(x)] =
                static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
        }
    }
    return pixels;
}

}  // namespace sonocase
