// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/winding_voxels.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/import/mesh/winding_number.h"

namespace sonocase::pipeline {
namespace {

// Rows lie beside the voxel centres by this, so that none runs through a vertex or along an edge of
// meshes with round coordinates.
constexpr double kBesideMm[3] = {0, 1.234567e-5, 2.345678e-5};
constexpr double kOpenStepVx = 8;

struct Crossing {
    float x_vx = 0;  // relative to the box
    int turn = 0;    // +1: the winding number rises
};

struct Rows {
    Int3 size;
    std::vector<std::vector<Crossing>> of;  // # size.y * size.z
};

Int3 clamp_voxel(Point3 v, Int3 size, bool up) {
    Int3 out;
    for (int axis = 0; axis < 3; ++axis) {
        const double x = up ? std::ceil(v[axis]) : std::floor(v[axis]);
        out[axis] = static_cast<int>(std::clamp(x, 0.0, static_cast<double>(size[axis] - 1)));
    }
    return out;
}

// Where a triangle passes rows: a, b, c in voxels of the box.
void cross_rows(Vector3 a, Vector3 b, Vector3 c, Rows& rows) {
    const double area = (b.y - a.y) * (c.z - a.z) - (b.z - a.z) * (c.y - a.y);
    if (area == 0) return;
    const int j0 = std::max(0, static_cast<int>(std::ceil(std::min({a.y, b.y, c.y}))));
    const int j1 =
        std::min(rows.size.y - 1, static_cast<int>(std::floor(std::max({a.y, b.y, c.y}))));
    const int k0 = std::max(0, static_cast<int>(std::ceil(std::min({a.z, b.z, c.z}))));
    const int k1 =
        std::min(rows.size.z - 1, static_cast<int>(std::floor(std::max({a.z, b.z, c.z}))));
    for (int k = k0; k <= k1; ++k)
        for (int j = j0; j <= j1; ++j) {
            const auto side = [&](Vector3 p, Vector3 q) {
                return (q.y - p.y) * (k - p.z) - (q.z - p.z) * (j - p.y);
            };
            const double wa = side(b, c) / area, wb = side(c, a) / area, wc = side(a, b) / area;
            if (wa < 0 || wb < 0 || wc < 0) continue;
            const double x = wa * a.x + wb * b.x + wc * c.x;
            // The outward normal's x has the sign of the area: the surface is left there.
            rows.of[static_cast<std::size_t>(j) +
                    static_cast<std::size_t>(rows.size.y) * static_cast<std::size_t>(k)]
                .push_back({static_cast<float>(x), area > 0 ? -1 : 1});
        }
}

void fill_closed(const std::vector<Crossing>& row, int size, std::uint8_t* out) {
    int winding = 0;
    std::size_t next = 0;
    for (int i = 0; i < size; ++i) {
        while (next < row.size() && row[next].x_vx <= static_cast<float>(i))
            winding += row[next++].turn;
        out[i] = winding != 0;
    }
}

void fill_open(const std::vector<Crossing>& row,
               const WindingTree& tree,
               const Grid& grid,
               Int3 first,
               int size,
               std::uint8_t* out) {
    if (row.empty()) return;  // nothing is passed: outside
    std::size_t next = 0;
    int i = 0;
    while (i < size) {
        while (next < row.size() && row[next].x_vx <= static_cast<float>(i)) ++next;
        const double until =
            next < row.size() ? std::min<double>(size, std::ceil(row[next].x_vx)) : size;
        const int end = std::max(i + 1, static_cast<int>(std::min(until, i + kOpenStepVx)));
        const Point3 p =
            grid.point_from_voxel({first.x + 0.5 * (i + end - 1), static_cast<double>(first.y),
                                   static_cast<double>(first.z)});
        const bool inside = std::abs(tree.at(p)) > 0.5;
        for (; i < end; ++i) out[i] = inside;
    }
}

}  // namespace

std::size_t VoxelMask::count() const {
    std::size_t sum = 0;
    for (const std::uint8_t v : inside) sum += v;
    return sum;
}

VoxelMask voxelise(
    const Surface& solid, bool closed, const Grid& grid, int margin_vx, double accuracy) {
    VoxelMask mask;
    Box3 box;
    for (const auto& t : solid.triangles)
        for (const std::uint32_t corner : t)
            box.include(grid.voxel_from_point(solid.points[corner]));
    for (int axis = 0; axis < 3; ++axis)
        if (box.empty() || box.upper[axis] < 0 || box.lower[axis] > grid.size[axis] - 1)
            return mask;
    const double m = margin_vx;
    const Int3 low = clamp_voxel(box.lower - Vector3{m, m, m}, grid.size, false);
    const Int3 high = clamp_voxel(box.upper + Vector3{m, m, m}, grid.size, true);
    mask.first = low;
    mask.size = {high.x - low.x + 1, high.y - low.y + 1, high.z - low.z + 1};
    mask.inside.assign(static_cast<std::size_t>(mask.size.x) *
                           static_cast<std::size_t>(mask.size.y) *
                           static_cast<std::size_t>(mask.size.z),
                       0);
    Rows rows{mask.size, {}};
    rows.of.resize(static_cast<std::size_t>(mask.size.y) * static_cast<std::size_t>(mask.size.z));
    const Vector3 origin{static_cast<double>(low.x), static_cast<double>(low.y),
                         static_cast<double>(low.z)};
    const auto relative = [&](std::uint32_t corner) {
        Point3 p = solid.points[corner];
        for (int axis = 0; axis < 3; ++axis) p[axis] -= kBesideMm[axis];
        return (grid.voxel_from_point(p) - Point3{}) - origin;
    };
    for (const auto& t : solid.triangles)
        cross_rows(relative(t[0]), relative(t[1]), relative(t[2]), rows);
    const Surface none;
    const WindingTree tree(closed ? none : solid, accuracy);
    parallel_for(static_cast<std::size_t>(mask.size.z), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
            for (int j = 0; j < mask.size.y; ++j) {
                auto& row = rows.of[static_cast<std::size_t>(j) +
                                    static_cast<std::size_t>(mask.size.y) * k];
                std::sort(row.begin(), row.end(), [](const Crossing& a, const Crossing& b) {
                    return a.x_vx != b.x_vx ? a.x_vx < b.x_vx : a.turn > b.turn;
                });
                std::uint8_t* out = mask.inside.data() + mask.index(0, j, static_cast<int>(k));
                if (closed)
                    fill_closed(row, mask.size.x, out);
                else
                    fill_open(row, tree, grid, {low.x, low.y + j, low.z + static_cast<int>(k)},
                              mask.size.x, out);
            }
    });
    return mask;
}

}  // namespace sonocase::pipeline
