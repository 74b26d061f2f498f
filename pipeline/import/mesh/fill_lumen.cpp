// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/fill_lumen.h"

#include <array>
#include <vector>

namespace sonocase::pipeline {
namespace {

using Bytes = std::vector<std::uint8_t>;

// By one voxel along the axes.
Bytes grown(const VoxelMask& mask, const Bytes& from) {
    Bytes out = from;
    const auto sx = static_cast<std::size_t>(mask.size.x);
    const std::size_t sxy = sx * static_cast<std::size_t>(mask.size.y);
    for (int k = 0; k < mask.size.z; ++k)
        for (int j = 0; j < mask.size.y; ++j)
            for (int i = 0; i < mask.size.x; ++i) {
                const std::size_t n = mask.index(i, j, k);
                if (!from[n]) continue;
                if (i > 0) out[n - 1] = 1;
                if (i + 1 < mask.size.x) out[n + 1] = 1;
                if (j > 0) out[n - sx] = 1;
                if (j + 1 < mask.size.y) out[n + sx] = 1;
                if (k > 0) out[n - sxy] = 1;
                if (k + 1 < mask.size.z) out[n + sxy] = 1;
            }
    return out;
}

// One slice of the mask: n(u, v) is its voxel number.
struct Slice {
    std::size_t first, step_u, step_v;
    int size_u, size_v;
    std::size_t at(int u, int v) const {
        return first + static_cast<std::size_t>(u) * step_u + static_cast<std::size_t>(v) * step_v;
    }
};

// Marks the holes of a slice of at most `most` voxels.
void mark_holes(const Slice& slice, const Bytes& wall, std::size_t most, Bytes& lumen) {
    const auto places =
        static_cast<std::size_t>(slice.size_u) * static_cast<std::size_t>(slice.size_v);
    Bytes seen(places, 0);
    std::vector<std::array<int, 2>> part;
    for (int v0 = 0; v0 < slice.size_v; ++v0)
        for (int u0 = 0; u0 < slice.size_u; ++u0) {
            const auto place = [&](int u, int v) {
                return static_cast<std::size_t>(u) +
                       static_cast<std::size_t>(slice.size_u) * static_cast<std::size_t>(v);
            };
            if (seen[place(u0, v0)] || wall[slice.at(u0, v0)]) continue;
            part.assign(1, {u0, v0});
            seen[place(u0, v0)] = 1;
            bool open = false;
            for (std::size_t n = 0; n < part.size(); ++n) {
                const auto [u, v] = part[n];
                for (const auto& [du, dv] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
                    const int x = u + du, y = v + dv;
                    if (x < 0 || y < 0 || x >= slice.size_u || y >= slice.size_v) {
                        open = true;
                        continue;
                    }
                    if (seen[place(x, y)] || wall[slice.at(x, y)]) continue;
                    seen[place(x, y)] = 1;
                    part.push_back({x, y});
                }
            }
            if (open || part.size() > most) continue;
            for (const auto& [u, v] : part) lumen[slice.at(u, v)] = 1;
        }
}

}  // namespace

std::size_t fill_lumen(VoxelMask& wall, const LumenOptions& options) {
    if (wall.inside.empty()) return 0;
    const Bytes closed = grown(wall, wall.inside);
    const auto most =
        static_cast<std::size_t>(options.hole_mm2 / (options.voxel_mm * options.voxel_mm));
    Bytes lumen(wall.inside.size(), 0);
    const auto sx = static_cast<std::size_t>(wall.size.x);
    const std::size_t step[3] = {1, sx, sx * static_cast<std::size_t>(wall.size.y)};
    for (int axis = 0; axis < 3; ++axis) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (int n = 0; n < wall.size[axis]; ++n)
            mark_holes({static_cast<std::size_t>(n) * step[axis], step[u], step[v], wall.size[u],
                        wall.size[v]},
                       closed, most, lumen);
    }
    lumen = grown(wall, lumen);
    std::size_t added = 0;
    for (std::size_t n = 0; n < lumen.size(); ++n) {
        added += lumen[n] && !wall.inside[n];
        wall.inside[n] |= lumen[n];
    }
    return added;
}

}  // namespace sonocase::pipeline
