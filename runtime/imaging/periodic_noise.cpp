#include "runtime/imaging/periodic_noise.h"

#include <cmath>

#include "runtime/imaging/noise.h"

namespace sonocase::runtime {
namespace {

// Running sums along one axis; rows of `stride` neighbours go together.
void box(const std::vector<float>& in,
         std::vector<float>& out,
         std::size_t n,
         std::size_t stride,
         std::size_t reach) {
    for (std::size_t base = 0; base < in.size(); base += n * stride) {
        for (std::size_t j = 0; j < n; ++j) {
            float* to = out.data() + base + j * stride;
            if (j == 0) {
                for (std::size_t i = 0; i < stride; ++i) to[i] = 0;
                for (std::size_t k = 0; k <= 2 * reach; ++k) {
                    const float* from = in.data() + base + (n - reach + k) % n * stride;
                    for (std::size_t i = 0; i < stride; ++i) to[i] += from[i];
                }
                continue;
            }
            const float* before = to - stride;
            const float* add = in.data() + base + (j + reach) % n * stride;
            const float* drop = in.data() + base + (j + n - reach - 1) % n * stride;
            for (std::size_t i = 0; i < stride; ++i) to[i] = before[i] + (add[i] - drop[i]);
        }
    }
}

}  // namespace

std::vector<float> smooth_periodic_noise(int edge, int reach, std::uint32_t seed) {
    const auto n = static_cast<std::size_t>(edge);
    std::vector<float> a(n * n * n), b(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        a[i] = static_cast<float>(hash32(seed + static_cast<std::uint32_t>(i) * 2654435761u) >> 8) *
                   0x1p-24f -
               0.5f;
    }
    for (int pass = 0; pass < 2; ++pass) {
        for (const std::size_t stride : {std::size_t{1}, n, n * n}) {
            box(a, b, n, stride, static_cast<std::size_t>(reach));
            std::swap(a, b);
        }
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
