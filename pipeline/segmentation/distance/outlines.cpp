// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/outlines.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace sonocase::pipeline {
namespace {

// 8-connected components of equal label in slice k, by union-find. Appends them with sums instead
// of moments.
void add_outlines(const LabelVolume& volume, int k, OutlineMap* out) {
    const int nx = volume.grid.size.x, ny = volume.grid.size.y;
    const std::size_t base = volume.grid.index(0, 0, k);
    const std::uint8_t* label = volume.voxels.data() + base;
    const auto at = [nx](int i, int j) {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(nx) * static_cast<std::size_t>(j);
    };
    std::vector<std::int32_t> parent(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::size_t v) {
        while (static_cast<std::size_t>(parent[v]) != v) {
            parent[v] = parent[static_cast<std::size_t>(parent[v])];
            v = static_cast<std::size_t>(parent[v]);
        }
        return v;
    };
    for (int j = 0; j < ny; ++j) {
        for (int i = 0; i < nx; ++i) {
            const std::size_t v = at(i, j);
            const auto join = [&](int a, int b) {
                if (a < 0 || a >= nx || b < 0 || label[at(a, b)] != label[v]) return;
                const std::size_t p = root(v), q = root(at(a, b));
                parent[std::max(p, q)] = static_cast<std::int32_t>(std::min(p, q));
            };
            join(i - 1, j);
            join(i - 1, j - 1);
            join(i, j - 1);
            join(i + 1, j - 1);
        }
    }
    std::vector<std::int32_t> outline_of_root(parent.size(), -1);
    for (int j = 0; j < ny; ++j) {
        for (int i = 0; i < nx; ++i) {
            const std::size_t v = at(i, j), r = root(v);
            if (outline_of_root[r] < 0) {  // roots come first in scan order
                outline_of_root[r] = static_cast<std::int32_t>(out->outlines.size());
                out->outlines.push_back({k, label[v], {{i, j, k}, {1, 1, 1}}, 0, 0, 0});
            }
            Outline& o = out->outlines[static_cast<std::size_t>(outline_of_root[r])];
            out->of_voxel[base + v] = outline_of_root[r];
            const int x1 = std::max(o.box.first.x + o.box.size.x, i + 1);
            o.box.first.x = std::min(o.box.first.x, i);
            o.box.size.x = x1 - o.box.first.x;
            o.box.size.y = j + 1 - o.box.first.y;
            ++o.area;
            o.x += i;
            o.y += j;
            o.xx += static_cast<double>(i) * i;
            o.xy += static_cast<double>(i) * j;
            o.yy += static_cast<double>(j) * j;
        }
    }
}

}  // namespace

bool Outline::elongated() const {
    const double mean = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
    return mean + spread > 6.25 * (mean - spread + 1.0 / 12);  // 2.5 times as long as wide
}

double Outline::direction_rad() const {
    return 0.5 * std::atan2(2 * xy, xx - yy);
}

OutlineMap find_outlines(const LabelVolume& volume) {
    OutlineMap out;
    out.of_voxel.assign(volume.grid.voxel_count(), -1);
    for (int k = 0; k < volume.grid.size.z; ++k) add_outlines(volume, k, &out);
    for (Outline& o : out.outlines) {
        o.x /= o.area;
        o.y /= o.area;
        o.xx = o.xx / o.area - o.x * o.x;
        o.xy = o.xy / o.area - o.x * o.y;
        o.yy = o.yy / o.area - o.y * o.y;
    }
    return out;
}

}  // namespace sonocase::pipeline
