// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/noise/periodic_noise.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/imaging/noise/noise.h"

namespace sonocase::runtime {
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
    const auto n = static_cast<std::size_t>(edge), width = static_cast<std::size_t>(reach);
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
