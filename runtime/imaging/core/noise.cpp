// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/noise.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/base/constants.h"

namespace sonocase::runtime {

double inverse_normal(double p) {
    // Start from a logistic fit and polish with Newton steps on the normal distribution function.
    double x = 5.5556 * (1 - std::pow((1 - p) / p, 0.1186));
    if (!(x > -8 && x < 8)) x = p < 0.5 ? -6 : 6;
    double step = 1;
    for (int i = 0; i < 6 && std::abs(step) > 1e-12; ++i) {
        const double tail = 0.5 * std::erfc(-x / std::sqrt(2.0));
        const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * kPi);
        step = std::clamp((tail - p) / density, -1.0, 1.0);
        x -= step;
    }
    return x;
}

namespace {

constexpr std::uint32_t kLevels = 4096;  // equally likely values

}  // namespace

std::vector<double> normal_levels() {
    constexpr std::uint32_t half = kLevels / 2;
    std::vector<double> upper(half);
    for (std::uint32_t i = 0; i < half; ++i) upper[i] = inverse_normal((half + i + 0.5) / kLevels);
    return upper;
}

std::vector<std::int8_t> make_noise_tile(std::span<const double> upper,
                                         double sigma,
                                         std::uint32_t seed,
                                         int overhang) {
    // Each of the equally likely values once, in an order drawn by the seed: the tile's own mean
    // and deviation are then exact.
    std::vector<std::int8_t> tile(kNoiseTile + overhang);
    for (std::uint32_t i = 0; i < kLevels / 2; ++i) {
        const double value = std::min(std::round(sigma * upper[i]), 127.0);
        for (std::uint32_t j = 0; j < kNoiseTile; j += kLevels) {
            tile[j + kLevels / 2 + i] = static_cast<std::int8_t>(value);
            tile[j + kLevels / 2 - 1 - i] = static_cast<std::int8_t>(-value);
        }
    }
    for (std::uint32_t i = kNoiseTile - 1; i > 0; --i) {
        const std::uint32_t j = static_cast<std::uint32_t>(
            (static_cast<std::uint64_t>(hash32(seed + i * 0x85EBCA6Bu)) * (i + 1)) >> 32);
        std::swap(tile[i], tile[j]);
    }
    for (int i = 0; i < overhang; ++i) tile[kNoiseTile + i] = tile[i % kNoiseTile];
    return tile;
}

namespace {

// Values are summed this many at a time, in vectors; the number of values is a multiple of it.
constexpr std::size_t kAtOnce = 16;

void add(const float* from, float* to, std::size_t n) {
    for (std::size_t i = 0; i < n; i += kAtOnce) {
        float sum[kAtOnce];
        for (std::size_t k = 0; k < kAtOnce; ++k) sum[k] = to[i + k] + from[i + k];
        for (std::size_t k = 0; k < kAtOnce; ++k) to[i + k] = sum[k];
    }
}

// Sums of 2 * reach + 1 neighbours along rows of n > reach.
void box_along_rows(const RawVector<float>& in,
                    RawVector<float>& out,
                    std::size_t n,
                    std::size_t reach) {
    std::vector<float> row(n + 2 * reach);
    for (std::size_t base = 0; base < in.size(); base += n) {
        const float* from = in.data() + base;
        std::copy_n(from + n - reach, reach, row.data());
        std::copy_n(from, n, row.data() + reach);
        std::copy_n(from, reach, row.data() + reach + n);
        float* to = out.data() + base;
        std::copy_n(row.data(), n, to);
        for (std::size_t k = 1; k <= 2 * reach; ++k) add(row.data() + k, to, n);
    }
}

// The same across them: running sums of `stride` neighbours at once.
void box_across(const RawVector<float>& in,
                RawVector<float>& out,
                std::size_t n,
                std::size_t stride,
                std::size_t reach) {
    for (std::size_t base = 0; base < in.size(); base += n * stride) {
        for (std::size_t j = 0; j < n; ++j) {
            float* to = out.data() + base + j * stride;
            if (j == 0) {
                for (std::size_t i = 0; i < stride; ++i) to[i] = 0;
                for (std::size_t k = 0; k <= 2 * reach; ++k)
                    add(in.data() + base + (n - reach + k) % n * stride, to, stride);
                continue;
            }
            const float* before = to - stride;
            const float* come = in.data() + base + (j + reach) % n * stride;
            const float* gone = in.data() + base + (j + n - reach - 1) % n * stride;
            for (std::size_t i = 0; i < stride; i += kAtOnce) {
                float sum[kAtOnce];
                for (std::size_t k = 0; k < kAtOnce; ++k)
                    sum[k] = before[i + k] + (come[i + k] - gone[i + k]);
                for (std::size_t k = 0; k < kAtOnce; ++k) to[i + k] = sum[k];
            }
        }
    }
}

}  // namespace

RawVector<float> smooth_periodic_noise(int edge, int reach, std::uint32_t seed) {
    const std::size_t n = edge, width = reach;
    RawVector<float> a(n * n * n), b(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        a[i] = static_cast<float>(hash32(seed + static_cast<std::uint32_t>(i) * 2654435761u) >> 8) *
                   0x1p-24f -
               0.5f;
    }
    for (int pass = 0; pass < 2; ++pass) {
        box_along_rows(a, b, n, width);
        box_across(b, a, n, n, width);
        box_across(a, b, n, n * n, width);
        std::swap(a, b);
    }
    double sum = 0, square = 0;
    for (const float v : a) {
        sum += static_cast<double>(v);
        square += static_cast<double>(v) * static_cast<double>(v);
    }
    const double mean = sum / static_cast<double>(a.size());
    const double deviation = std::sqrt(square / static_cast<double>(a.size()) - mean * mean);
    for (float& v : a) v = static_cast<float>((static_cast<double>(v) - mean) / deviation);
    return a;
}

}  // namespace sonocase::runtime
