// SPDX-License-Identifier: Apache-2.0

// Autocorrelation of grey: estimated from masked images, measured in volumes, and its widths.
#pragma once

#include <span>
#include <vector>

#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

// Correlation at whole-pixel lags -reach..reach in both directions, 1 at lag 0, x fastest.
// Point-symmetric: at(-x, -y) = at(x, y).
struct Autocorrelation {
    int reach = 0;
    std::vector<double> value;    // # (2 reach + 1)^2
    std::vector<double> overlap;  // # same: share of pixel pairs at the lag; empty: all (a cube)

    double at(int x, int y) const {
        return value[static_cast<std::size_t>((y + reach) * (2 * reach + 1) + x + reach)];
    }
    double& at(int x, int y) {
        return value[static_cast<std::size_t>((y + reach) * (2 * reach + 1) + x + reach)];
    }
    double window(int x, int y) const {
        return overlap.empty()
                   ? 1
                   : overlap[static_cast<std::size_t>((y + reach) * (2 * reach + 1) + x + reach)];
    }
    // Bilinear; 0 beyond the reach.
    double between(double x, double y) const;
};

// Of the used pixels of all examples together, each about its own mean and deviation. Every lag is
// divided by the number of pixel pairs that it has; lags with fewer than a twentieth of the pixels
// as pairs are given 0.
Autocorrelation autocorrelation(std::span<const ExampleImage> examples, int reach);

// Of the planes z = const of a cube that wraps, averaged over all of them; reach <= edge / 2.
Autocorrelation plane_autocorrelation(std::span<const float> cube, int edge, int reach);

// What is left of an image, or of each plane z = const of a wrapping cube, when its Gaussian mean
// of deviation sigma_px is taken off; the overall mean stays. Correlation widths of real patches
// are only comparable after this: shading across the patch would otherwise count as grain.
ExampleImage without_local_trend(const ExampleImage& image, double sigma_px);
std::vector<float> without_local_trend(std::span<const float> cube, int edge, double sigma_px);
inline constexpr double kGrainTrendPx = 12;  // as in the published table of the real patches

// The correlation as a window of the example's size shows it: each lag times its share of pixel
// pairs, the usual estimate from one image. Long lags of a small patch are mostly chance, and half
// heights read from them would be chance too. Widths of an example and of a texture are compared
// through the example's window.
Autocorrelation through_window(const Autocorrelation& autocorrelation,
                               const Autocorrelation& window);

// Full widths at half height, in pixels, along the direction in which the correlation reaches
// furthest and at right angles to it.
// A correlation that never falls to a half within the reach has twice the reach for its width.
struct CorrelationWidths {
    double along = 0;
    double across = 0;
    double angle_rad = 0;  // of `along` against +x, towards +y (down), in [0, pi)
    double ratio() const { return across > 0 ? along / across : 0; }
};
// At every stride-th lag.
Autocorrelation at_stride(const Autocorrelation& autocorrelation, int stride);

CorrelationWidths correlation_widths(const Autocorrelation& autocorrelation);

}  // namespace sonocase::pipeline
