// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/spline_penalty.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration_fit {
namespace {

std::array<double, 4> spline_values(double t, int derivative) {
    const double s = 1 - t;
    switch (derivative) {
        case 0:
            return {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
                    (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6};
        case 1: return {-s * s / 2, (3 * t * t - 4 * t) / 2, -(3 * s * s - 4 * s) / 2, t * t / 2};
        default: return {s, 3 * t - 2, 1 - 3 * t, t};
    }
}

// Mean over the cells of an axis of B_i^(n) B_(i + offset)^(n), in units of a cell, at
// [i][offset + 3]. Four Gauss points integrate degree 6 exactly.
using Gram = std::vector<std::array<double, 7>>;
Gram gram(int controls, int derivative) {
    constexpr double kNode[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813,
                                 0.93056815579702629};
    constexpr double kWeight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                   0.17392742256872693};
    Gram g(static_cast<std::size_t>(controls));
    for (auto& row : g) row.fill(0);
    const int cells = controls - 3;
    for (int q = 0; q < 4; ++q) {
        const std::array<double, 4> v = spline_values(kNode[q], derivative);
        for (int c = 0; c < cells; ++c) {
            for (int a = 0; a < 4; ++a) {
                for (int b = 0; b < 4; ++b) {
                    g[c + a][b - a + 3] += kWeight[q] * v[a] * v[b] / cells;
                }
            }
        }
    }
    return g;
}

}  // namespace

DisplacementGrid grid_over(const Box3& box, double spacing_mm) {
    DisplacementGrid grid;
    grid.spacing_mm = spacing_mm;
    const Vector3 e = box.extent();
    for (int a = 0; a < 3; ++a) {
        const int cells = std::max(1, static_cast<int>(std::ceil(e[a] / spacing_mm)));
        grid.size[a] = cells + 3;
        grid.origin_mm[a] = box.lower[a] - 0.5 * (cells * spacing_mm - e[a]);
    }
    return grid;
}

SplineFootprint spline_footprint(const DisplacementGrid& grid, Point3 p) {
    SplineFootprint f;
    std::array<double, 4> w[3];
    int first[3];
    for (int a = 0; a < 3; ++a) {
        const int cells = grid.size[a] - 3;
        const double u = std::clamp((p[a] - grid.origin_mm[a]) / grid.spacing_mm, 0.0,
                                    static_cast<double>(cells));
        first[a] = std::min(static_cast<int>(u), cells - 1);
        w[a] = spline_values(u - first[a], 0);
    }
    f.first =
        static_cast<std::size_t>(first[0]) +
        static_cast<std::size_t>(grid.size.x) *
            (static_cast<std::size_t>(first[1]) + static_cast<std::size_t>(grid.size.y) * first[2]);
    for (std::size_t n = 0; n < 64; ++n) {
        f.weight[n] = static_cast<float>(w[0][n % 4] * w[1][n / 4 % 4] * w[2][n / 16]);
    }
    return f;
}

std::size_t footprint_offset(const DisplacementGrid& grid, int n) {
    return static_cast<std::size_t>(n % 4) +
           static_cast<std::size_t>(grid.size.x) *
               (static_cast<std::size_t>(n / 4 % 4) +
                static_cast<std::size_t>(grid.size.y) * static_cast<std::size_t>(n / 16));
}

SplinePenalty::SplinePenalty(const DisplacementGrid& grid,
                             double hessian_weight,
                             double gradient_weight) {
    grid_.size = grid.size;
    grid_.origin_mm = grid.origin_mm;
    grid_.spacing_mm = grid.spacing_mm;
    std::vector<Gram> g[3];
    for (int a = 0; a < 3; ++a) {
        for (int d = 0; d < 3; ++d) g[a].push_back(gram(grid.size[a], d));
    }
    const double h2 = 1 / (grid.spacing_mm * grid.spacing_mm);
    const double hessian = hessian_weight * h2 * h2, gradient = gradient_weight * h2;
    // Derivatives in x, y, z and the weight of each product.
    const struct {
        int x, y, z;
        double weight;
    } terms[] = {{2, 0, 0, hessian},     {0, 2, 0, hessian},     {0, 0, 2, hessian},
                 {1, 1, 0, 2 * hessian}, {1, 0, 1, 2 * hessian}, {0, 1, 1, 2 * hessian},
                 {1, 0, 0, gradient},    {0, 1, 0, gradient},    {0, 0, 1, gradient}};
    const auto nx = static_cast<std::size_t>(grid.size.x),
               ny = static_cast<std::size_t>(grid.size.y),
               nz = static_cast<std::size_t>(grid.size.z);
    row_.assign(nx * ny * nz * 343, 0);
    parallel_for(nz, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            for (std::size_t j = 0; j < ny; ++j) {
                for (std::size_t i = 0; i < nx; ++i) {
                    float* row = row_.data() + 343 * (i + nx * (j + ny * k));
                    for (std::size_t c = 0; c < 7; ++c) {
                        for (std::size_t b = 0; b < 7; ++b) {
                            double along_x[3] = {0, 0, 0};  // by derivative in x
                            for (const auto& t : terms) {
                                along_x[t.x] += t.weight * g[1][t.y][j][b] * g[2][t.z][k][c];
                            }
                            for (std::size_t a = 0; a < 7; ++a) {
                                row[a + 7 * (b + 7 * c)] = static_cast<float>(
                                    along_x[0] * g[0][0][i][a] + along_x[1] * g[0][1][i][a] +
                                    along_x[2] * g[0][2][i][a]);
                            }
                        }
                    }
                }
            }
        }
    });
}

void SplinePenalty::add_point(Point3 p, double weight) {
    const SplineFootprint f = spline_footprint(grid_, p);
    for (int n = 0; n < 64; ++n) {
        float* row = row_.data() + 343 * (f.first + footprint_offset(grid_, n));
        const float w = static_cast<float>(weight) * f.weight[n];
        const int ni = n % 4, nj = n / 4 % 4, nk = n / 16;
        for (int m = 0; m < 64; ++m) {
            const int a = m % 4 - ni + 3, b = m / 4 % 4 - nj + 3, c = m / 16 - nk + 3;
            row[a + 7 * (b + 7 * c)] += w * f.weight[m];
        }
    }
}

void SplinePenalty::apply(std::span<const Lanes> in, std::span<Lanes> out) const {
    const int nx = grid_.size.x, ny = grid_.size.y, nz = grid_.size.z;
    parallel_for(ny * nz, 8, [&](std::size_t begin, std::size_t end) {
        for (std::size_t line = begin; line < end; ++line) {
            const int j = static_cast<int>(line) % ny, k = static_cast<int>(line) / ny;
            for (int i = 0; i < nx; ++i) {
                const int node = i + nx * static_cast<int>(line);
                const float* row = row_.data() + 343 * static_cast<std::size_t>(node);
                Lanes sum = {0, 0, 0, 0};
                const int a0 = std::max(-3, -i), a1 = std::min(3, nx - 1 - i);
                for (int c = std::max(-3, -k); c <= std::min(3, nz - 1 - k); ++c) {
                    for (int b = std::max(-3, -j); b <= std::min(3, ny - 1 - j); ++b) {
                        const float* w = row + 7 * (b + 3) + 49 * (c + 3) + 3;
                        const Lanes* v = in.data() + node + nx * (b + ny * c);
                        for (int a = a0; a <= a1; ++a) sum += w[a] * v[a];
                    }
                }
                out[node] = sum;
            }
        }
    });
}

}  // namespace sonocase::pipeline::inline registration_fit
