// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/texture/autocorrelation.h"
#include "pipeline/texture/fourier.h"

namespace sonocase::pipeline {
namespace {

TEST(Fourier, CubeReturnsAndFindsASingleWave) {
    const int n = 16;
    std::vector<std::complex<float>> cube(n * n * n);
    for (int z = 0; z < n; ++z)
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x)
                cube[x + n * (y + n * z)] =
                    static_cast<float>(std::cos(2 * M_PI * (2 * x + 3 * y + 5 * z) / n));
    const auto before = cube;
    fourier_cube(cube, n, false);
    for (int z = 0; z < n; ++z)
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x) {
                const bool peak = (x == 2 && y == 3 && z == 5) || (x == 14 && y == 13 && z == 11);
                EXPECT_NEAR(std::abs(cube[x + n * (y + n * z)]), peak ? n * n * n / 2 : 0,
                            2e-3);  // 4096 terms of 1e-7
            }
    fourier_cube(cube, n, true);
    for (std::size_t i = 0; i < cube.size(); ++i)
        EXPECT_NEAR(std::abs(cube[i] - before[i]), 0, 1e-5);
}

TEST(Autocorrelation, OfAMaskedImageIsThatOfItsPixelPairs) {
    ExampleImage image{"test", 23, 17, {}, {}};
    image.grey.resize(image.count());
    image.use.resize(image.count());
    for (std::size_t i = 0; i < image.count(); ++i) {
        image.grey[i] = static_cast<float>(255 * uniform_at(9, i));
        image.use[i] = uniform_at(10, i) < 0.8;
    }
    const ExampleImage one[] = {image};
    const Autocorrelation fast = autocorrelation(one, 5);
    double mean = 0, count = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) mean += image.grey[i], count += 1;
    }
    mean /= count;
    const auto pairs = [&](int dx, int dy) {
        double sum = 0, n = 0;
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x) {
                const int u = x + dx, v = y + dy;
                if (u < 0 || v < 0 || u >= image.width || v >= image.height) continue;
                if (!image.used(image.index(x, y)) || !image.used(image.index(u, v))) continue;
                sum +=
                    (image.grey[image.index(x, y)] - mean) * (image.grey[image.index(u, v)] - mean);
                n += 1;
            }
        return sum / n;
    };
    for (int y = -5; y <= 5; ++y)
        for (int x = -5; x <= 5; ++x) EXPECT_NEAR(fast.at(x, y), pairs(x, y) / pairs(0, 0), 1e-9);
}

}  // namespace
}  // namespace sonocase::pipeline
