// SPDX-License-Identifier: Apache-2.0

// Autocorrelation of grey: estimated from masked images or measured in cubes, its widths, and the
// removal of the local trend of grey before it.
#pragma once

#include <span>
#include <vector>

#include "pipeline/texture/example_image.h"

namespace sonocase::pipeline::inline texture {

// Correlation at whole-pixel lags -reach..reach in both directions, 1 at lag 0, x fastest.
// Point-symmetric: at(-x, -y) = at(x, y).
struct Autocorrelation {
    int reach = 0;
    std::vector<double> value;  // # (2 reach + 1)^2
    // # same: pixel pairs at the lag per used pixel; empty: 1 (a cube).
    std::vector<double> overlap;

    double at(int x, int y) const { return value[(y + reach) * (2 * reach + 1) + x + reach]; }
    double& at(int x, int y) { return value[(y + reach) * (2 * reach + 1) + x + reach]; }
    double window(int x, int y) const {
        return overlap.empty() ? 1 : overlap[(y + reach) * (2 * reach + 1) + x + reach];
    }
    // Bilinear; 0 beyond the reach.
    double between(double x, double y) const;
};

// Takes the used pixels of all examples together, each standardised by its own mean and standard
// deviation. Every lag is divided by its number of pixel pairs; lags with fewer pairs than a
// twentieth of the pixels are 0. Cost: three transforms of the padded image.
Autocorrelation autocorrelation(std::span<const ExampleImage> examples, int reach);

// Takes the planes z = const of a cube that wraps, averaged over all of them; reach <= edge / 2.
Autocorrelation plane_autocorrelation(std::span<const float> cube, int edge, int reach);

// The correlation weighted like an estimate from an image of the size of `window`'s example: each
// lag times its share of pixel pairs. Long lags of a small patch are mostly chance, and so would be
// a half-height among them. Widths of an example and of a texture are therefore compared through
// the example's window. window.overlap must not be empty.
Autocorrelation through_window(const Autocorrelation& autocorrelation,
                               const Autocorrelation& window);

// Full widths at half height, in pixels, along the direction in which the correlation reaches
// furthest and at right angles to it. If it does not fall to a half within the reach, the width is
// twice the reach.
struct CorrelationWidths {
    double along = 0;
    double across = 0;
    double angle_rad = 0;  // of `along` against +x, towards +y (down), in [0, pi)
    double ratio() const { return across > 0 ? along / across : 0; }
};
CorrelationWidths correlation_widths(const Autocorrelation& autocorrelation);

// Returns every stride-th lag.
Autocorrelation at_stride(const Autocorrelation& autocorrelation, int stride);

// Standard deviation of the local trend of grey, as in the published table of the real patches.
// Correlation widths of real patches are comparable only after its removal: shading across the
// patch would otherwise count as grain.
inline constexpr double kGrainTrendPx = 12;

// Returns an image minus its Gaussian mean of standard deviation sigma_px; the overall mean is
// kept.
ExampleImage without_local_trend(const ExampleImage& image, double sigma_px);

// Does the same for each plane z = const of a cube that wraps; # edge^3, edge even.
std::vector<float> without_local_trend(std::span<const float> cube, int edge, double sigma_px);

// Gain of that removal for each wave of a plane that wraps, in [0, 1]; # edge^2, x fastest.
std::vector<double> local_trend_gain(int edge, double sigma_px);

}  // namespace sonocase::pipeline::inline texture
