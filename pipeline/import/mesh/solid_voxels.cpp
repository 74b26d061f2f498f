// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/solid_voxels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline import_mesh {

namespace {

constexpr std::uint32_t kLeaf = 8;

double solid_angle(Point3 p, Point3 a, Point3 b, Point3 c) {
    const Vector3 u = a - p, v = b - p, w = c - p;
    const double lu = norm(u), lv = norm(v), lw = norm(w);
    const double across = dot(u, cross(v, w));
    const double along = lu * lv * lw + dot(u, v) * lw + dot(v, w) * lu + dot(w, u) * lv;
    return 2 * std::atan2(across, along);
}

Point3 middle_of(const Surface& s, std::uint32_t t) {
    const auto& c = s.triangles[t];
    return Point3{} + (1.0 / 3) * ((s.points[c[0]] - Point3{}) + (s.points[c[1]] - Point3{}) +
                                   (s.points[c[2]] - Point3{}));
}

}  // namespace

double winding_number(const Surface& surface, Point3 p) {
    double sum = 0;
    for (const auto& t : surface.triangles)
        sum += solid_angle(p, surface.points[t[0]], surface.points[t[1]], surface.points[t[2]]);
    return sum / (4 * kPi);
}

WindingTree::WindingTree(const Surface& surface, double accuracy)
    : surface_(surface), accuracy_(accuracy), order_(surface.triangles.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    if (order_.empty()) return;
    boxes_.push_back({});
    boxes_[0].count = static_cast<std::uint32_t>(order_.size());
    build(0, 0);
}

void WindingTree::summarise(Box& box) const {
    double area = 0;
    Vector3 centre;
    for (std::uint32_t n = box.first; n < box.first + box.count; ++n) {
        const auto& t = surface_.triangles[order_[n]];
        const Vector3 normal = 0.5 * cross(surface_.points[t[1]] - surface_.points[t[0]],
                                           surface_.points[t[2]] - surface_.points[t[0]]);
        box.dipole = box.dipole + normal;
        area += norm(normal);
        centre = centre + norm(normal) * (middle_of(surface_, order_[n]) - Point3{});
    }
    if (area > 0)
        box.centre = Point3{} + (1 / area) * centre;
    else
        box.centre = middle_of(surface_, order_[box.first]);
    for (std::uint32_t n = box.first; n < box.first + box.count; ++n)
        for (const std::uint32_t corner : surface_.triangles[order_[n]])
            box.radius = std::max(box.radius, distance(surface_.points[corner], box.centre));
}

void WindingTree::build(std::uint32_t index, int depth) {
    summarise(boxes_[index]);
    const std::uint32_t first = boxes_[index].first, count = boxes_[index].count;
    if (count <= kLeaf || depth > 60) return;
    Box3 extent;
    for (std::uint32_t n = first; n < first + count; ++n)
        extent.include(middle_of(surface_, order_[n]));
    const Vector3 size = extent.extent();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const auto begin = order_.begin() + first;
    std::nth_element(
        begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
            const double x = middle_of(surface_, a)[axis], y = middle_of(surface_, b)[axis];
            return x != y ? x < y : a < b;
        });
    const auto child = static_cast<std::uint32_t>(boxes_.size());
    boxes_[index].child = child;
    boxes_.resize(boxes_.size() + 2);
    boxes_[child].first = first;
    boxes_[child].count = count / 2;
    boxes_[child + 1].first = first + count / 2;
    boxes_[child + 1].count = count - count / 2;
    build(child, depth + 1);
    build(child + 1, depth + 1);
}

double WindingTree::at(Point3 p) const {
    if (boxes_.empty()) return 0;
    double sum = 0;
    std::uint32_t stack[128];
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const Box& box = boxes_[stack[--top]];
        const Vector3 to = box.centre - p;
        const double r = norm(to);
        if (r > accuracy_ * box.radius) {
            sum += dot(to, box.dipole) / (r * r * r);
        } else if (box.child != 0) {
            stack[top++] = box.child;
            stack[top++] = box.child + 1;
        } else {
            for (std::uint32_t n = box.first; n < box.first + box.count; ++n) {
                const auto& t = surface_.triangles[order_[n]];
                sum += solid_angle(p, surface_.points[t[0]], surface_.points[t[1]],
                                   surface_.points[t[2]]);
            }
        }
    }
    return sum / (4 * kPi);
}

namespace {

// Rows lie this far beside the voxel centres, so that none runs through a vertex or along an edge
// of a mesh with round coordinates.
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

// Notes where a triangle crosses rows. a, b, c: in voxels of the box.
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
            rows.of[j + static_cast<std::size_t>(rows.size.y) * k].push_back(
                {static_cast<float>(x), area > 0 ? -1 : 1});
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
    mask.inside.assign(static_cast<std::size_t>(mask.size.x) * mask.size.y * mask.size.z, 0);
    Rows rows{mask.size, {}};
    rows.of.resize(static_cast<std::size_t>(mask.size.y) * mask.size.z);
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
    parallel_for(mask.size.z, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
            for (int j = 0; j < mask.size.y; ++j) {
                auto& row = rows.of[j + static_cast<std::size_t>(mask.size.y) * k];
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

namespace {

using Bytes = std::vector<std::uint8_t>;

// The mask grown by one voxel along the axes.
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

// Marks the holes of a slice of at most `max_voxels` voxels.
void mark_holes(const Slice& slice, const Bytes& wall, std::size_t max_voxels, Bytes& lumen) {
    const auto places = static_cast<std::size_t>(slice.size_u) * slice.size_v;
    Bytes seen(places, 0);
    std::vector<std::array<int, 2>> part;
    for (int v0 = 0; v0 < slice.size_v; ++v0)
        for (int u0 = 0; u0 < slice.size_u; ++u0) {
            const auto place = [&](int u, int v) {
                return u + static_cast<std::size_t>(slice.size_u) * v;
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
            if (open || part.size() > max_voxels) continue;
            for (const auto& [u, v] : part) lumen[slice.at(u, v)] = 1;
        }
}

}  // namespace

std::size_t fill_lumen(VoxelMask& wall, const LumenOptions& options) {
    if (wall.inside.empty()) return 0;
    const Bytes closed = grown(wall, wall.inside);
    const auto max_voxels =
        static_cast<std::size_t>(options.hole_mm2 / (options.voxel_mm * options.voxel_mm));
    Bytes lumen(wall.inside.size(), 0);
    const auto sx = static_cast<std::size_t>(wall.size.x);
    const std::size_t step[3] = {1, sx, sx * static_cast<std::size_t>(wall.size.y)};
    for (int axis = 0; axis < 3; ++axis) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (int n = 0; n < wall.size[axis]; ++n)
            mark_holes({static_cast<std::size_t>(n) * step[axis], step[u], step[v], wall.size[u],
                        wall.size[v]},
                       closed, max_voxels, lumen);
    }
    lumen = grown(wall, lumen);
    std::size_t added = 0;
    for (std::size_t n = 0; n < lumen.size(); ++n) {
        added += lumen[n] && !wall.inside[n];
        wall.inside[n] |= lumen[n];
    }
    return added;
}

}  // namespace sonocase::pipeline::inline import_mesh
