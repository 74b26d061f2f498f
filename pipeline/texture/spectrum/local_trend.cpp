// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/spectrum/local_trend.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "pipeline/texture/spectrum/fourier.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.141592653589793238463;

}  // namespace

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
                    s += taps[static_cast<std::size_t>(t + reach)] *
                         values[image.index(x + t * dx, y + t * dy)];
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
    const auto n = static_cast<std::size_t>(edge);
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
    const auto n = static_cast<std::size_t>(edge);
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

}  // namespace sonocase::pipeline
