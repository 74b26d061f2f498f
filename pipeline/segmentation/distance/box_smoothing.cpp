// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/box_smoothing.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

// out[l] = sum_m kernel[m] in[l + (m - half) stride], lines of `width` values.
void smooth_lines(const float* in,
                  std::size_t width,
                  int lines,
                  std::size_t pitch,
                  const std::vector<float>& kernel,
                  int stride,
                  float* out) {
    const int half = static_cast<int>(kernel.size() / 2);
    for (int l = 0; l < lines; ++l) {
        float* to = out + static_cast<std::size_t>(l) * pitch;
        std::fill(to, to + width, 0.0f);
        for (int m = -half; m <= half; ++m) {
            const float* from =
                in + static_cast<std::size_t>(std::clamp(l + m * stride, 0, lines - 1)) * pitch;
            const float k = kernel[static_cast<std::size_t>(m + half)];
            for (std::size_t i = 0; i < width; ++i) to[i] += k * from[i];
        }
    }
}

void smooth_rows(const float* in,
                 int count,
                 std::size_t rows,
                 const std::vector<float>& kernel,
                 int stride,
                 float* out) {
    const int reach = static_cast<int>(kernel.size() / 2) * stride;
    std::vector<float> padded(static_cast<std::size_t>(count + 2 * reach));
    for (std::size_t r = 0; r < rows; ++r) {
        const float* row = in + r * static_cast<std::size_t>(count);
        float* to = out + r * static_cast<std::size_t>(count);
        std::fill(padded.begin(), padded.begin() + reach, row[0]);
        std::copy(row, row + count, padded.begin() + reach);
        std::fill(padded.end() - reach, padded.end(), row[count - 1]);
        std::fill(to, to + count, 0.0f);
        for (std::size_t m = 0; m < kernel.size(); ++m) {
            const float k = kernel[m];
            const float* from = padded.data() + m * static_cast<std::size_t>(stride);
            for (int i = 0; i < count; ++i) to[i] += k * from[i];
        }
    }
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
    std::vector<double> gauss(static_cast<std::size_t>(2 * reach + 1));
    double sum = 0;
    for (int i = -reach; i <= reach; ++i) {
        const double g = std::exp(-0.5 * i * i / (sigma * sigma));
        gauss[static_cast<std::size_t>(i + reach)] = g;
        sum += g;
    }
    for (double& g : gauss) g /= sum;
    std::vector<double> kernel(static_cast<std::size_t>(4 * reach + 1));
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
    if (!kernels.taps[0].empty()) {
        smooth_rows(values->data(), box.size.x, ny * nz, kernels.taps[0], kernels.stride[0],
                    scratch->data());
        values->swap(*scratch);
    }
    if (!kernels.taps[1].empty()) {
        for (std::size_t k = 0; k < nz; ++k) {
            const std::size_t at = k * nx * ny;
            smooth_lines(values->data() + at, nx, box.size.y, nx, kernels.taps[1],
                         kernels.stride[1], scratch->data() + at);
        }
        values->swap(*scratch);
    }
    if (!kernels.taps[2].empty()) {
        for (std::size_t j = 0; j < ny; ++j) {
            const std::size_t at = j * nx;
            smooth_lines(values->data() + at, nx, box.size.z, nx * ny, kernels.taps[2],
                         kernels.stride[2], scratch->data() + at);
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

}  // namespace sonocase::pipeline
