// SPDX-License-Identifier: Apache-2.0

#include "peer_eq10.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::bench {
namespace {

using Field = std::vector<float>;

struct Neighbours {  // offsets; beyond the grid its border is repeated
    std::ptrdiff_t xm, xp, ym, yp, zm, zp;
};

template <class Update>  // (voxel index, i, j, k, neighbours)
void for_each_voxel(Int3 n, const Update& update) {
    pipeline::parallel_for(n.z, 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < n.y; ++j) {
                for (int i = 0; i < n.x; ++i) {
                    const std::ptrdiff_t row = n.x, slice = row * n.y;
                    const Neighbours by{i > 0 ? -1 : 0,     i + 1 < n.x ? 1 : 0,
                                        j > 0 ? -row : 0,   j + 1 < n.y ? row : 0,
                                        k > 0 ? -slice : 0, k + 1 < n.z ? slice : 0};
                    update(i + row * j + slice * k, i, j, k, by);
                }
            }
        }
    });
}

// Sum of the principal curvatures in 1/voxel; no more than a voxel can show.
float curvature(const float* p, const Neighbours& by) {
    const float x = 0.5f * (p[by.xp] - p[by.xm]), y = 0.5f * (p[by.yp] - p[by.ym]),
                z = 0.5f * (p[by.zp] - p[by.zm]);
    const float xx = p[by.xp] - 2 * p[0] + p[by.xm], yy = p[by.yp] - 2 * p[0] + p[by.ym],
                zz = p[by.zp] - 2 * p[0] + p[by.zm];
    const auto mixed = [&](std::ptrdiff_t am, std::ptrdiff_t ap, std::ptrdiff_t bm,
                           std::ptrdiff_t bp) {
        return 0.25f * (p[ap + bp] - p[am + bp] - p[ap + bm] + p[am + bm]);
    };
    const float xy = mixed(by.xm, by.xp, by.ym, by.yp), xz = mixed(by.xm, by.xp, by.zm, by.zp),
                yz = mixed(by.ym, by.yp, by.zm, by.zp);
    const float square = x * x + y * y + z * z;
    const float top = xx * (y * y + z * z) + yy * (x * x + z * z) + zz * (x * x + y * y) -
                      2 * (xy * x * y + xz * x * z + yz * y * z);
    // Without a slope there is no surface: 0 / 0 is taken as 0.
    return square < 1e-4f ? 0 : std::clamp(top / (square * std::sqrt(square)), -2.0f, 2.0f);
}

float trilinear(const Field& field, Int3 n, float x, float y, float z) {
    const auto cell = [](float v, int size, float* part) {
        v = std::clamp(v, 0.0f, static_cast<float>(size - 1));
        const int i = std::min(static_cast<int>(v), size - 2);
        *part = v - static_cast<float>(i);
        return i;
    };
    float u, v, w;
    const int i = cell(x, n.x, &u), j = cell(y, n.y, &v), k = cell(z, n.z, &w);
    const std::ptrdiff_t row = n.x, slice = row * n.y;
    const float* p = field.data() + i + row * j + slice * k;
    const auto along = [&](const float* q) { return q[0] + u * (q[1] - q[0]); };
    const float low = along(p) + v * (along(p + row) - along(p));
    const float high = along(p + slice) + v * (along(p + slice + row) - along(p + slice));
    return low + w * (high - low);
}

}  // namespace

LabelVolume eq10_over_whole_grid(const LabelVolume& volume,
                                 const pipeline::LevelSetOptions& options) {
    const Int3 n = volume.grid.size;
    const double h_mm = volume.grid.spacing_mm.x;
    const double step = options.time_step > 0 ? options.time_step
                                              : 0.8 * pipeline::max_stable_step(options.k0, h_mm);
    // In voxels: phi / h, K0 and time as they are, C / h^2.
    const float pull = static_cast<float>(step * options.k0),
                bend = static_cast<float>(step / (h_mm * h_mm));
    LabelVolume smooth = volume;
    Field start, phi, next(volume.voxels.size()), curve(next.size()), best(next.size(), INFINITY);
    for (std::size_t l = 0; l < volume.labels.size(); ++l) {
        // Cut at 10 voxels: beyond, nothing that the recomposition could see moves.
        pipeline::signed_distance(volume, static_cast<std::uint8_t>(l), {{0, 0, 0}, n}, 10 * h_mm,
                                  {true, true, true}, &start);
        for (float& d : start) d /= static_cast<float>(h_mm);
        phi = start;
        for (int t = 0; t < options.iterations; ++t) {
            for_each_voxel(n, [&](std::ptrdiff_t at, int, int, int, const Neighbours& by) {
                curve[at] = curvature(phi.data() + at, by);
            });
            for_each_voxel(n, [&](std::ptrdiff_t at, int i, int j, int k, const Neighbours& by) {
                const float* p = phi.data() + at;
                const Vector3 slope{p[by.xp] - p[by.xm], p[by.yp] - p[by.ym], p[by.zp] - p[by.zm]};
                const double length = norm(slope);
                const Vector3 go = length > 0.02 ? (p[0] / length) * slope : Vector3{};
                const float c =
                    trilinear(curve, n, static_cast<float>(i - go.x), static_cast<float>(j - go.y),
                              static_cast<float>(k - go.z));
                next[at] = p[0] + pull * (start[at] - p[0]) + bend * c;
            });
            std::swap(phi, next);
        }
        for (std::size_t v = 0; v < phi.size(); ++v) {
            if (phi[v] >= best[v]) continue;
            best[v] = phi[v];
            smooth.voxels[v] = static_cast<std::uint8_t>(l);
        }
    }
    return smooth;
}

}  // namespace sonocase::bench
