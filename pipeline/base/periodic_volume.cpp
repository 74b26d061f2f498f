// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/periodic_volume.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace sonocase::pipeline::inline base {
namespace {

std::size_t cube(int edge) {
    return static_cast<std::size_t>(edge) * edge * edge;
}

// Unsigned key with the same order as the floats.
std::uint32_t order_key(float value) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

}  // namespace

void lowpass_periodic(std::vector<float>& volume, int edge, int gap) {
    std::vector<float> out(cube(edge));
    const auto n = static_cast<std::size_t>(edge);
    // Along each axis an output line is the sum of five lines; `line` is its length in memory.
    for (int axis = 0; axis < 3; ++axis) {
        const std::size_t line = axis == 0 ? 1 : axis == 1 ? n : n * n;
        const std::size_t blocks = cube(edge) / (line * n);
        for (std::size_t b = 0; b < blocks; ++b) {
            const float* in = volume.data() + b * line * n;
            float* to = out.data() + b * line * n;
            for (int i = 0; i < edge; ++i) {
                const auto at = [&](int d) {
                    return in +
                           line * static_cast<std::size_t>(((i + d * gap) % edge + edge) % edge);
                };
                const float *a = at(-2), *p = at(-1), *c = at(0), *q = at(1), *e = at(2);
                float* t = to + line * static_cast<std::size_t>(i);
                for (std::size_t k = 0; k < line; ++k) {
                    t[k] = (a[k] + e[k] + 4 * (p[k] + q[k]) + 6 * c[k]) * (1 / 16.f);
                }
            }
        }
        volume.swap(out);
    }
}

std::vector<float> double_resolution(const std::vector<float>& volume, int edge) {
    const int n = 2 * edge;
    std::vector<float> out(cube(n), 0.f);
    for (int z = 0; z < edge; ++z) {
        for (int y = 0; y < edge; ++y) {
            for (int x = 0; x < edge; ++x) {
                const auto to = 2 * x + static_cast<std::size_t>(n) *
                                            (2 * y + static_cast<std::size_t>(n) *
                                                         static_cast<std::size_t>(2 * z));
                const auto from =
                    static_cast<std::size_t>(x) +
                    static_cast<std::size_t>(edge) * (y + static_cast<std::size_t>(edge) * z);
                out[to] = 8 * volume[from];
            }
        }
    }
    lowpass_periodic(out, n, 1);
    return out;
}

void match_distribution(std::span<float> values, std::span<const float> sorted) {
    const std::size_t n = values.size();
    if (n == 0 || sorted.empty()) return;
    // Radix sort of (key, position) pairs; it is stable, such that equal values keep their order.
    std::vector<std::uint64_t> items(n), other(n);
    for (std::size_t i = 0; i < n; ++i) {
        items[i] = static_cast<std::uint64_t>(order_key(values[i])) << 32 | i;
    }
    for (int shift = 32; shift < 64; shift += 11) {
        const std::uint64_t mask = shift == 54 ? 0x3FF : 0x7FF;
        std::vector<std::size_t> begin(2049, 0);
        for (const std::uint64_t item : items) ++begin[(item >> shift & mask) + 1];
        for (std::size_t b = 1; b < begin.size(); ++b) begin[b] += begin[b - 1];
        for (const std::uint64_t item : items) other[begin[item >> shift & mask]++] = item;
        items.swap(other);
    }
    const std::size_t m = sorted.size();
    for (std::size_t r = 0; r < n; ++r) {
        // the quantile at (r + 1/2) / n
        const std::size_t q = ((2 * r + 1) * m) / (2 * n);
        values[items[r] & 0xFFFFFFFFu] = sorted[std::min(q, m - 1)];
    }
}

}  // namespace sonocase::pipeline::inline base
