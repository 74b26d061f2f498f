// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/box_smoothing.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/segmentation/distance/widest.h"

namespace sonocase::pipeline::inline segmentation_distance {
namespace {

// out[i] = sum_m kernel[m] from[m][i] for `count` values, in the order of the taps. The sums of
// a few neighbours stay in registers over all taps.
__attribute__((always_inline)) inline void weigh(const float* kernel,
                                                 std::size_t taps,
                                                 const float* const* from,
                                                 std::size_t count,
                                                 float* out) {
    typedef float Eight __attribute__((vector_size(32)));
    constexpr std::size_t kBatch = 32;
    std::size_t i = 0;
    for (; i + kBatch <= count; i += kBatch) {
        Eight a{}, b{}, c{}, d{}, v;
        for (std::size_t m = 0; m < taps; ++m) {
            const float* values = from[m] + i;
            const float k = kernel[m];
            __builtin_memcpy(&v, values, sizeof v);
            a += k * v;
            __builtin_memcpy(&v, values + 8, sizeof v);
            b += k * v;
            __builtin_memcpy(&v, values + 16, sizeof v);
            c += k * v;
            __builtin_memcpy(&v, values + 24, sizeof v);
            d += k * v;
        }
        __builtin_memcpy(out + i, &a, sizeof a);
        __builtin_memcpy(out + i + 8, &b, sizeof b);
        __builtin_memcpy(out + i + 16, &c, sizeof c);
        __builtin_memcpy(out + i + 24, &d, sizeof d);
    }
    for (; i < count; ++i) {
        float sum = 0;
        for (std::size_t m = 0; m < taps; ++m) sum += kernel[m] * from[m][i];
        out[i] = sum;
    }
}

// A row of one value costs one value: `constant` holds it, or NaN for a row of several.
constexpr float kSeveral = std::numeric_limits<float>::quiet_NaN();

// out[l] = sum_m kernel[m] in[l + (m - half) stride], lines of `width` values; constant: of line l
// in [l * constant_pitch], brought up to date.
SONOCASE_WIDEST void smooth_lines(const float* in,
                                  std::size_t width,
                                  int lines,
                                  std::size_t pitch,
                                  const std::vector<float>& kernel,
                                  int stride,
                                  float* constant,
                                  std::size_t constant_pitch,
                                  float* out) {
    const int half = static_cast<int>(kernel.size() / 2);
    std::vector<const float*> from(kernel.size());
    std::vector<float> before(lines);
    for (std::size_t l = 0; l < before.size(); ++l) before[l] = constant[l * constant_pitch];
    for (int l = 0; l < lines; ++l) {
        float sum = 0;  // NaN where one of the lines holds several values
        for (int m = -half; m <= half; ++m) {
            const auto at = static_cast<std::size_t>(std::clamp(l + m * stride, 0, lines - 1));
            const auto tap = static_cast<std::size_t>(m + half);
            from[tap] = in + at * pitch;
            sum += kernel[tap] * before[at];
        }
        float* to = out + static_cast<std::size_t>(l) * pitch;
        constant[static_cast<std::size_t>(l) * constant_pitch] = sum;
        if (sum == sum) {
            std::fill(to, to + width, sum);
        } else {
            weigh(kernel.data(), kernel.size(), from.data(), width, to);
        }
    }
}

SONOCASE_WIDEST void smooth_rows(const float* in,
                                 int count,
                                 std::size_t rows,
                                 const std::vector<float>& kernel,
                                 int stride,
                                 float* constant,
                                 float* out) {
    const int reach = static_cast<int>(kernel.size() / 2) * stride;
    std::vector<float> padded(count + 2 * reach);
    std::vector<const float*> from(kernel.size());
    for (std::size_t m = 0; m < from.size(); ++m)
        from[m] = padded.data() + m * static_cast<std::size_t>(stride);
    for (std::size_t r = 0; r < rows; ++r) {
        const float* row = in + r * static_cast<std::size_t>(count);
        float* to = out + r * static_cast<std::size_t>(count);
        if (constant[r] == constant[r]) {
            float sum = 0;
            for (const float k : kernel) sum += k * row[0];
            std::fill(to, to + count, sum);
            constant[r] = sum;
            continue;
        }
        std::fill(padded.begin(), padded.begin() + reach, row[0]);
        std::copy(row, row + count, padded.begin() + reach);
        std::fill(padded.end() - reach, padded.end(), row[count - 1]);
        weigh(kernel.data(), kernel.size(), from.data(), static_cast<std::size_t>(count), to);
    }
}

std::vector<float> constants_of(const std::vector<float>& values, std::size_t nx) {
    std::vector<float> constant(values.size() / nx);
    for (std::size_t r = 0; r < constant.size(); ++r) {
        const float* row = values.data() + r * nx;
        const bool same = row[0] == row[nx - 1] && row[0] == row[nx / 2] &&
                          std::all_of(row, row + nx, [&](float v) { return v == row[0]; });
        constant[r] = same ? row[0] : kSeveral;
    }
    return constant;
}

}  // namespace

int BoxKernels::reach(int axis) const {
    const auto a = static_cast<std::size_t>(axis);
    return static_cast<int>(taps[a].size() / 2) * stride[a];
}

std::vector<float> smoothing_kernel(double sigma, double moment) {
    if (sigma <= 0) return {};
    const double a = 2 + moment / (sigma * sigma);
    const int reach = std::max(2, static_cast<int>(std::ceil(3.2 * sigma)));
    std::vector<double> gauss(2 * reach + 1);
    double sum = 0;
    for (int i = -reach; i <= reach; ++i) {
        const double g = std::exp(-0.5 * i * i / (sigma * sigma));
        gauss[i + reach] = g;
        sum += g;
    }
    for (double& g : gauss) g /= sum;
    std::vector<double> kernel(4 * reach + 1);
    for (std::size_t i = 0; i < gauss.size(); ++i) {
        kernel[i + static_cast<std::size_t>(reach)] += a * gauss[i];
        for (std::size_t j = 0; j < gauss.size(); ++j)
            kernel[i + j] -= (a - 1) * gauss[i] * gauss[j];
    }
    // Ends below a thousandth are cut, and the rest is normalised again.
    std::size_t cut = 0;
    while (cut + 1 < kernel.size() / 2 && std::abs(kernel[cut]) < 1e-3) ++cut;
    std::vector<float> out;
    double kept = 0;
    for (std::size_t i = cut; i + cut < kernel.size(); ++i) kept += kernel[i];
    for (std::size_t i = cut; i + cut < kernel.size(); ++i)
        out.push_back(static_cast<float>(kernel[i] / kept));
    return out;
}

std::vector<float> spreading_kernel(double sigma) {
    const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
    std::vector<float> kernel;
    for (int i = -reach; i <= reach; ++i) {
        kernel.push_back(static_cast<float>(std::exp(0.7 - 0.5 * i * i / (sigma * sigma))));
    }
    return kernel;
}

void smooth_box(const VoxelBox& box,
                const BoxKernels& kernels,
                std::vector<float>* values,
                std::vector<float>* scratch) {
    scratch->resize(values->size());
    const std::size_t nx = static_cast<std::size_t>(box.size.x);
    const std::size_t ny = static_cast<std::size_t>(box.size.y);
    const std::size_t nz = static_cast<std::size_t>(box.size.z);
    if (values->empty()) return;
    std::vector<float> constant = constants_of(*values, nx);
    if (!kernels.taps[0].empty()) {
        smooth_rows(values->data(), box.size.x, ny * nz, kernels.taps[0], kernels.stride[0],
                    constant.data(), scratch->data());
        values->swap(*scratch);
    }
    if (!kernels.taps[1].empty()) {
        for (std::size_t k = 0; k < nz; ++k) {
            const std::size_t at = k * nx * ny;
            smooth_lines(values->data() + at, nx, box.size.y, nx, kernels.taps[1],
                         kernels.stride[1], constant.data() + k * ny, 1, scratch->data() + at);
        }
        values->swap(*scratch);
    }
    if (!kernels.taps[2].empty()) {
        for (std::size_t j = 0; j < ny; ++j) {
            const std::size_t at = j * nx;
            smooth_lines(values->data() + at, nx, box.size.z, nx * ny, kernels.taps[2],
                         kernels.stride[2], constant.data() + j, ny, scratch->data() + at);
        }
        values->swap(*scratch);
    }
}

void crop(const VoxelBox& box,
          const std::vector<float>& values,
          const VoxelBox& part,
          std::vector<float>* out) {
    out->resize(part.count());
    for (int k = 0; k < part.size.z; ++k) {
        for (int j = 0; j < part.size.y; ++j) {
            const std::size_t from =
                box.index(part.first.x - box.first.x, part.first.y - box.first.y + j,
                          part.first.z - box.first.z + k);
            std::copy_n(values.data() + from, part.size.x, out->data() + part.index(0, j, k));
        }
    }
}

void shrink(const VoxelBox& box, const VoxelBox& part, std::vector<float>* values) {
    if (box.count() == part.count()) return;
    for (int k = 0; k < part.size.z; ++k) {
        for (int j = 0; j < part.size.y; ++j) {
            const std::size_t from =
                box.index(part.first.x - box.first.x, part.first.y - box.first.y + j,
                          part.first.z - box.first.z + k);
            // No row moves beyond its own place, so those that follow are still whole.
            std::copy_n(values->data() + from, part.size.x, values->data() + part.index(0, j, k));
        }
    }
    values->resize(part.count());
}

}  // namespace sonocase::pipeline::inline segmentation_distance
