// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/autocorrelation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>

#include "formats/base/constants.h"
#include "pipeline/texture/fourier.h"

namespace sonocase::pipeline::inline texture {

namespace {

int power_of_two_from(int n) {
    int p = 1;
    while (p < n) p *= 2;
    return p;
}

// Sums over all pairs of used pixels at each lag: products of standardised grey, and the number of
// pairs.
struct PairSums {
    std::vector<double> product, count;  // # (2 reach + 1)^2
};

PairSums sum_pairs(const ExampleImage& image, const GreyMoments& m, int reach) {
    const double mean = m.mean, sd = m.sd();
    // The plane is padded, such that no lag wraps.
    const int w = power_of_two_from(image.width + reach);
    const int h = power_of_two_from(image.height + reach);
    const auto size = static_cast<std::size_t>(w) * h;
    std::vector<std::complex<double>> plane(size), mask(size);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            const std::size_t i = image.index(x, y);
            if (!image.used(i)) continue;
            const std::size_t to = x + static_cast<std::size_t>(w) * y;
            plane[to] = (image.grey[i] - mean) / sd;
            mask[to] = 1;
        }
    }
    fourier_plane(plane, w, h, false);
    fourier_plane(mask, w, h, false);
    // |F|^2 of each is real and even: one transform returns both results, in its real and its
    // imaginary part.
    for (std::size_t i = 0; i < size; ++i) plane[i] = {std::norm(plane[i]), std::norm(mask[i])};
    fourier_plane(plane, w, h, true);
    const std::size_t lags = (2 * reach + 1) * (2 * reach + 1);
    PairSums sums{std::vector<double>(lags, 0), std::vector<double>(lags, 0)};
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            if (std::abs(x) >= image.width || std::abs(y) >= image.height) continue;
            const std::size_t from = (x + w) % w + static_cast<std::size_t>(w) * ((y + h) % h);
            const std::size_t to = (y + reach) * (2 * reach + 1) + x + reach;
            sums.product[to] = plane[from].real();
            sums.count[to] = std::round(plane[from].imag());
        }
    }
    return sums;
}

}  // namespace

double Autocorrelation::between(double x, double y) const {
    const double fx = std::floor(x), fy = std::floor(y);
    const int i = static_cast<int>(fx), j = static_cast<int>(fy);
    if (i < -reach || j < -reach || i >= reach || j >= reach) return 0;
    const double u = x - fx, v = y - fy;
    return (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) +
           v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1));
}

Autocorrelation autocorrelation(std::span<const ExampleImage> examples, int reach) {
    Autocorrelation out;
    out.reach = reach;
    out.value.assign((2 * reach + 1) * (2 * reach + 1), 0);
    std::vector<double> product(out.value.size(), 0), pairs(out.value.size(), 0);
    double used = 0;
    for (const ExampleImage& image : examples) {
        const GreyMoments m = grey_moments(image);
        if (!(m.sd() > 0)) continue;
        used += static_cast<double>(m.count);
        const PairSums sums = sum_pairs(image, m, reach);
        for (std::size_t i = 0; i < product.size(); ++i) {
            product[i] += sums.product[i];
            pairs[i] += sums.count[i];
        }
    }
    const double zero = product[product.size() / 2] / std::max(pairs[pairs.size() / 2], 1.0);
    out.overlap.resize(pairs.size());
    for (std::size_t i = 0; i < out.value.size(); ++i) {
        out.overlap[i] = used > 0 ? pairs[i] / used : 0;
        if (pairs[i] >= used / 20 && pairs[i] > 0 && zero > 0) {
            out.value[i] = std::clamp(product[i] / pairs[i] / zero, -1.0, 1.0);
        }
    }
    return out;
}

Autocorrelation plane_autocorrelation(std::span<const float> cube, int edge, int reach) {
    assert(reach <= edge / 2);
    const std::size_t n = edge;
    double mean = 0;
    for (const float v : cube) mean += v;
    mean /= static_cast<double>(cube.size());
    std::vector<std::complex<double>> sum(n * n), plane(n * n);
    for (std::size_t z = 0; z < n; z += 2) {
        // Two planes at once, as real and imaginary part: the even part of |F|^2 of the pair is the
        // sum of theirs.
        for (std::size_t i = 0; i < n * n; ++i) {
            plane[i] = {cube[z * n * n + i] - mean, cube[(z + 1) * n * n + i] - mean};
        }
        fourier_plane(plane, edge, edge, false);
        for (std::size_t i = 0; i < n * n; ++i) sum[i] += std::norm(plane[i]);
    }
    fourier_plane(sum, edge, edge, true);
    Autocorrelation out;
    out.reach = reach;
    out.value.resize((2 * reach + 1) * (2 * reach + 1));
    const double zero = sum[0].real();
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            const std::size_t i = torus_index(x, y, edge);
            out.at(x, y) = zero > 0 ? sum[i].real() / zero : 0;
        }
    }
    return out;
}

Autocorrelation at_stride(const Autocorrelation& autocorrelation, int stride) {
    Autocorrelation out;
    out.reach = autocorrelation.reach / stride;
    out.value.resize((2 * out.reach + 1) * (2 * out.reach + 1));
    if (!autocorrelation.overlap.empty()) out.overlap.resize(out.value.size());
    std::size_t to = 0;
    for (int y = -out.reach; y <= out.reach; ++y) {
        for (int x = -out.reach; x <= out.reach; ++x, ++to) {
            out.value[to] = autocorrelation.at(stride * x, stride * y);
            if (out.overlap.empty()) continue;
            out.overlap[to] = autocorrelation.window(stride * x, stride * y);
        }
    }
    return out;
}

Autocorrelation through_window(const Autocorrelation& autocorrelation,
                               const Autocorrelation& window) {
    assert(!window.overlap.empty());
    Autocorrelation out;
    out.reach = std::min(autocorrelation.reach, window.reach);
    out.value.resize((2 * out.reach + 1) * (2 * out.reach + 1));
    for (int y = -out.reach; y <= out.reach; ++y) {
        for (int x = -out.reach; x <= out.reach; ++x) {
            out.at(x, y) = autocorrelation.at(x, y) * window.window(x, y);
        }
    }
    return out;
}

CorrelationWidths correlation_widths(const Autocorrelation& autocorrelation) {
    const auto half_width = [&](double angle) {
        const double c = std::cos(angle), s = std::sin(angle);
        constexpr double kStep = 0.125;
        double before = 1;
        for (double r = kStep; r < autocorrelation.reach; r += kStep) {
            const double here = autocorrelation.between(r * c, r * s);
            if (here < 0.5) return r - kStep * (0.5 - here) / (before - here);
            before = here;
        }
        return static_cast<double>(autocorrelation.reach);
    };
    CorrelationWidths widths;
    constexpr int kAngles = 180;
    for (int i = 0; i < kAngles; ++i) {
        const double angle = kPi * i / kAngles;
        const double width = 2 * half_width(angle);
        if (width > widths.along) {
            widths.along = width;
            widths.angle_rad = angle;
        }
    }
    widths.across = 2 * half_width(widths.angle_rad + kPi / 2);
    return widths;
}

ExampleImage without_local_trend(const ExampleImage& image, double sigma_px) {
    const int reach = static_cast<int>(std::ceil(3 * sigma_px));
    std::vector<float> taps;
    for (int i = -reach; i <= reach; ++i) {
        taps.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma_px * sigma_px))));
    }
    std::vector<float> sum(image.count()), weight(image.count());
    double mean = 0, count = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (!image.used(i)) continue;
        sum[i] = image.grey[i];
        weight[i] = 1;
        mean += image.grey[i];
        count += 1;
    }
    mean /= std::max(count, 1.0);
    const auto pass = [&](std::vector<float>& values, int dx, int dy) {
        std::vector<float> out(values.size());
        for (int y = 0; y < image.height; ++y) {
            for (int x = 0; x < image.width; ++x) {
                const int place = dx * x + dy * y, end = dx * image.width + dy * image.height;
                const int from = std::max(-reach, -place), to = std::min(reach, end - 1 - place);
                float s = 0;
                for (int t = from; t <= to; ++t) {
                    s += taps[t + reach] * values[image.index(x + t * dx, y + t * dy)];
                }
                out[image.index(x, y)] = s;
            }
        }
        values.swap(out);
    };
    for (std::vector<float>* values : {&sum, &weight}) {
        pass(*values, 1, 0);
        pass(*values, 0, 1);
    }
    ExampleImage out = image;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) out.grey[i] += static_cast<float>(mean) - sum[i] / weight[i];
    }
    return out;
}

std::vector<float> without_local_trend(std::span<const float> cube, int edge, double sigma_px) {
    const std::size_t n = edge;
    const std::vector<double> gain = local_trend_gain(edge, sigma_px);
    double mean = 0;
    for (const float v : cube) mean += v;
    mean /= static_cast<double>(cube.size());
    std::vector<float> out(cube.size());
    std::vector<std::complex<double>> plane(n * n);
    for (std::size_t z = 0; z < n; z += 2) {  // two planes at once
        for (std::size_t i = 0; i < n * n; ++i) {
            plane[i] = {cube[z * n * n + i], cube[(z + 1) * n * n + i]};
        }
        fourier_plane(plane, edge, edge, false);
        for (std::size_t i = 0; i < n * n; ++i) plane[i] *= gain[i];
        fourier_plane(plane, edge, edge, true);
        for (std::size_t i = 0; i < n * n; ++i) {
            out[z * n * n + i] = static_cast<float>(mean + plane[i].real());
            out[(z + 1) * n * n + i] = static_cast<float>(mean + plane[i].imag());
        }
    }
    return out;
}

std::vector<double> local_trend_gain(int edge, double sigma_px) {
    const std::size_t n = edge;
    std::vector<double> gain(n * n);
    for (std::size_t i = 0; i < n * n; ++i) {
        const auto wave = [&](std::size_t k) {
            const double f = static_cast<double>(std::min(k, n - k)) / edge;
            return 2 * kPi * kPi * sigma_px * sigma_px * f * f;
        };
        gain[i] = 1 - std::exp(-wave(i % n) - wave(i / n));
    }
    return gain;
}

}  // namespace sonocase::pipeline::inline texture
