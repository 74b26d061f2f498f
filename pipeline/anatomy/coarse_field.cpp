// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/coarse_field.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

constexpr float kFar = 1e12f;

// Lower envelope of parabolas along one line.
void transform_line(
    const float* in, float* out, int n, std::vector<int>& v, std::vector<float>& z) {
    int k = 0;
    v[0] = 0;
    z[0] = -kFar;
    z[1] = kFar;
    for (int q = 1; q < n; ++q) {
        float s;
        for (;;) {
            const int p = v[k];
            s = ((in[q] + static_cast<float>(q) * static_cast<float>(q)) -
                 (in[p] + static_cast<float>(p) * static_cast<float>(p))) /
                static_cast<float>(2 * (q - p));
            if (s > z[k] || k == 0) break;
            --k;
        }
        if (s <= z[k]) {
            v[k] = q;
        } else {
            ++k;
            v[k] = q;
            z[k] = s;
        }
        z[static_cast<std::size_t>(k) + 1] = kFar;
    }
    k = 0;
    for (int q = 0; q < n; ++q) {
        while (z[static_cast<std::size_t>(k) + 1] < static_cast<float>(q)) ++k;
        const int p = v[k];
        out[q] = static_cast<float>((q - p) * (q - p)) + in[p];
    }
}

void along_axis(std::vector<float>& samples,
                Int3 size,
                int axis,
                const std::function<void(const float*, float*, int)>& line) {
    const auto nx = static_cast<std::size_t>(size.x), ny = static_cast<std::size_t>(size.y);
    const std::size_t stride = axis == 0 ? 1 : axis == 1 ? nx : nx * ny;
    const int n = size[axis];
    const int na = axis == 0 ? size.y : size.x;
    const int nb = axis == 2 ? size.y : size.z;
    parallel_for(nb, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<float> in(n), out(static_cast<std::size_t>(n));
        for (std::size_t b = begin; b < end; ++b) {
            for (std::size_t a = 0; a < static_cast<std::size_t>(na); ++a) {
                float* p = samples.data() + (axis == 0   ? nx * (a + ny * b)
                                             : axis == 1 ? a + nx * ny * b
                                                         : a + nx * b);
                for (std::size_t i = 0; i < in.size(); ++i) in[i] = p[i * stride];
                line(in.data(), out.data(), n);
                for (std::size_t i = 0; i < in.size(); ++i) p[i * stride] = out[i];
            }
        }
    });
}

}  // namespace

void squared_distance_transform(std::vector<float>& samples, Int3 size) {
    for (int axis = 0; axis < 3; ++axis) {
        along_axis(samples, size, axis, [](const float* in, float* out, int n) {
            thread_local std::vector<int> v;
            thread_local std::vector<float> z;
            v.resize(n);
            z.resize(static_cast<std::size_t>(n) + 1);
            transform_line(in, out, n, v, z);
        });
    }
}

float CoarseField::at(float i, float j, float k) const {
    const auto split = [this](float x, int n, int& low, float& t) {
        const float s = std::clamp(x / static_cast<float>(step), 0.f, static_cast<float>(n - 1));
        low = std::min(static_cast<int>(s), std::max(n - 2, 0));
        t = n > 1 ? s - static_cast<float>(low) : 0.f;
    };
    int a, b, c;
    float u, v, w;
    split(i, size.x, a, u);
    split(j, size.y, b, v);
    split(k, size.z, c, w);
    const std::size_t dx = size.x > 1 ? 1 : 0,
                      dy = size.y > 1 ? static_cast<std::size_t>(size.x) : 0;
    const std::size_t dz = size.z > 1 ? static_cast<std::size_t>(size.x) * size.y : 0;
    const float* p = value.data() + index(a, b, c);
    const auto mix = [](float from, float to, float t) { return from + t * (to - from); };
    const float low = mix(mix(p[0], p[dx], u), mix(p[dy], p[dx + dy], u), v);
    const float high = mix(mix(p[dz], p[dx + dz], u), mix(p[dy + dz], p[dx + dy + dz], u), v);
    return mix(low, high, w);
}

Vector3 CoarseField::gradient(float i, float j, float k) const {
    const auto h = static_cast<float>(step);
    return {(at(i + h, j, k) - at(i - h, j, k)) / (2 * h),
            (at(i, j + h, k) - at(i, j - h, k)) / (2 * h),
            (at(i, j, k + h) - at(i, j, k - h)) / (2 * h)};
}

CoarseField distance_inside(Int3 fine_size,
                            int step,
                            const std::function<bool(int, int, int)>& inside) {
    CoarseField field;
    field.step = step;
    field.size = {(fine_size.x + step - 1) / step, (fine_size.y + step - 1) / step,
                  (fine_size.z + step - 1) / step};
    field.value.resize(static_cast<std::size_t>(field.size.x) * field.size.y * field.size.z);
    parallel_for(field.size.z, 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < field.size.y; ++j) {
                for (int i = 0; i < field.size.x; ++i) {
                    field.value[field.index(i, j, k)] =
                        inside(i * step, j * step, k * step) ? kFar : 0.f;
                }
            }
        }
    });
    squared_distance_transform(field.value, field.size);
    const auto scale = static_cast<float>(step);
    // Without any voxel outside, the large value remains: every voxel is equally deep.
    for (float& v : field.value) v = scale * std::sqrt(std::min(v, 1e8f));
    for (int axis = 0; axis < 3; ++axis) {
        along_axis(field.value, field.size, axis, [](const float* in, float* out, int n) {
            for (int i = 0; i < n; ++i) {
                out[i] = 0.25f * (in[std::max(i - 1, 0)] + 2 * in[i] + in[std::min(i + 1, n - 1)]);
            }
        });
    }
    return field;
}

}  // namespace sonocase::pipeline::inline anatomy
