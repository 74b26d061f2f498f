// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/spectrum/torus_spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "pipeline/texture/spectrum/fourier.h"
#include "pipeline/texture/spectrum/local_trend.h"

namespace sonocase::pipeline {
namespace {

constexpr double kContour = 7;   // extra weight of lags near the half-height contour
constexpr double kZeroLag = 60;  // weight of lag 0

struct Term {
    std::vector<double> wanted, weight;  // # edge^2: per lag on the torus
};

Term term_of(const Autocorrelation& wanted, double scale, double strength, int edge) {
    const auto n = static_cast<std::size_t>(edge);
    const int half = edge / 2;
    const CorrelationWidths widths = correlation_widths(wanted);
    const double radius = std::clamp(0.75 * widths.along + 2, 3.0, 0.95 * half);
    Term term{std::vector<double>(n * n), std::vector<double>(n * n)};
    for (int y = -half; y < half; ++y) {
        for (int x = -half; x < half; ++x) {
            const std::size_t i = torus_index(x, y, edge);
            const bool known = std::abs(x) <= wanted.reach && std::abs(y) <= wanted.reach;
            term.wanted[i] = known ? scale * wanted.at(x, y) : 0;
            const double r = std::hypot(x, y) / radius;
            // Through the example's window, like the widths, which are read from the half-height
            // contour.
            const double window = known ? wanted.window(x, y) : 0;
            const double near_half = known ? (window * wanted.at(x, y) - 0.5) / 0.1 : 9;
            const double contour = 1 + kContour * std::exp(-near_half * near_half);
            term.weight[i] = strength * std::max(window * window, 0.003) *
                             (r < 1 ? contour : std::max(std::exp(-4 * (r - 1) * (r - 1)), 0.02));
        }
    }
    // Variance added as white noise would affect this lag alone, but lower all correlations.
    term.weight[0] = strength * kZeroLag;
    return term;
}

}  // namespace

std::vector<double> fit_torus_spectrum(const Autocorrelation& whole,
                                       const Autocorrelation& local,
                                       double share,
                                       double trend_vx,
                                       int edge,
                                       int iterations) {
    const auto n = static_cast<std::size_t>(edge);
    const std::size_t count = n * n;
    const Term a = term_of(whole, 1, 0.03, edge);
    const Term b = term_of(local, share, 3, edge);
    std::vector<double> gain = local_trend_gain(edge, trend_vx);  // of amplitudes
    for (double& g : gain) g *= g;
    // Both terms in one transform: `whole` in the real part, `local` in the imaginary part. Their
    // spectra are even: the autocorrelations are real, and so are the transforms of the residuals.
    std::vector<double> s(count, 1), before = s, leap = s;
    std::vector<std::complex<double>> plane(count);
    double momentum = 1;
    const double step = 1.0 / (3.03 * kZeroLag);  // 1 / (greatest weight of a + of b)
    for (int iteration = 0; iteration < iterations; ++iteration) {
        for (std::size_t i = 0; i < count; ++i) plane[i] = {leap[i], leap[i] * gain[i]};
        fourier_plane(plane, edge, edge, true);
        for (std::size_t i = 0; i < count; ++i) {
            plane[i] = {a.weight[i] * (plane[i].real() - a.wanted[i]),
                        b.weight[i] * (plane[i].imag() - b.wanted[i])};
        }
        fourier_plane(plane, edge, edge, false);
        before.swap(s);
        for (std::size_t i = 0; i < count; ++i) {
            s[i] = std::max(leap[i] - step * (plane[i].real() + gain[i] * plane[i].imag()), 0.0);
        }
        const double next = 0.5 * (1 + std::sqrt(1 + 4 * momentum * momentum));
        for (std::size_t i = 0; i < count; ++i) {
            leap[i] = s[i] + (momentum - 1) / next * (s[i] - before[i]);
        }
        momentum = next;
    }
    double sum = 0;
    for (const double v : s) sum += v;
    for (double& v : s) v *= static_cast<double>(count) / sum;
    return s;
}

}  // namespace sonocase::pipeline
