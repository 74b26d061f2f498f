// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/skin_mesh.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sonocase::runtime {
namespace {

struct Samples {
    Int3 n;
    std::vector<float> body;  // share of body around each sample, [0, 1]
    std::size_t index(int i, int j, int k) const {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(n.x) *
                   (static_cast<std::size_t>(j) +
                    static_cast<std::size_t>(n.y) * static_cast<std::size_t>(k));
    }
};

void smooth(Surface& mesh, int passes) {
    std::vector<Vector3> sum(mesh.points.size());
    std::vector<int> count(mesh.points.size());
    for (int pass = 0; pass < passes; ++pass) {
        // Taubin's pair of steps: the second restores the volume that the first removes.
        const double weight = pass % 2 == 0 ? 0.6 : -0.63;
        std::fill(sum.begin(), sum.end(), Vector3{});
        std::fill(count.begin(), count.end(), 0);
        for (const auto& t : mesh.triangles) {
            for (int a = 0; a < 3; ++a) {
                const std::uint32_t p = t[static_cast<std::size_t>(a)];
                const std::uint32_t q = t[static_cast<std::size_t>((a + 1) % 3)];
                sum[p] = sum[p] + (mesh.points[q] - mesh.points[p]);
                sum[q] = sum[q] + (mesh.points[p] - mesh.points[q]);
                ++count[p];
                ++count[q];
            }
        }
        for (std::size_t i = 0; i < mesh.points.size(); ++i) {
            if (count[i] > 0) mesh.points[i] = mesh.points[i] + (weight / count[i]) * sum[i];
        }
    }
}

}  // namespace

Surface skin_mesh(const CaseBundle& bundle, double step_mm) {
    const Int3 size = bundle.label_bricks.size;
    Surface mesh;
    if (size.x < 2 || size.y < 2 || size.z < 2) return mesh;
    const double step = std::max(step_mm / bundle.grid.spacing_mm.x, 1.0);  // in voxels
    Samples s;
    for (int a = 0; a < 3; ++a) s.n[a] = static_cast<int>((size[a] - 1) / step) + 1;
    s.body.resize(static_cast<std::size_t>(s.n.x) * s.n.y * s.n.z);
    for (int k = 0; k < s.n.z; ++k) {
        for (int j = 0; j < s.n.y; ++j) {
            for (int i = 0; i < s.n.x; ++i) {
                // Eight look-ups, each a quarter step off, so that slanted skin has no steps.
                float share = 0;
                for (int c = 0; c < 8; ++c) {
                    const auto at = [&](int n, int axis, int side) {
                        const double v = (n + (side ? 0.25 : -0.25)) * step;
                        return std::clamp(static_cast<int>(v + 0.5), 0, size[axis] - 1);
                    };
                    const int label = bundle.label_bricks.at(at(i, 0, c & 1), at(j, 1, c >> 1 & 1),
                                                             at(k, 2, c >> 2));
                    if (label != 0) share += 0.125f;
                }
                s.body[s.index(i, j, k)] = share;
            }
        }
    }
    // One vertex per cell that the surface passes, in the middle of the crossed edges.
    std::vector<std::int32_t> vertex(s.body.size(), -1);
    for (int k = 0; k + 1 < s.n.z; ++k) {
        for (int j = 0; j + 1 < s.n.y; ++j) {
            for (int i = 0; i + 1 < s.n.x; ++i) {
                Vector3 sum;
                int crossings = 0;
                for (int c = 0; c < 8; ++c) {
                    const Int3 p{c & 1, (c >> 1) & 1, c >> 2};
                    for (int a = 0; a < 3; ++a) {
                        if (p[a] == 1) continue;
                        Int3 q = p;
                        q[a] = 1;
                        const float from = s.body[s.index(i + p.x, j + p.y, k + p.z)];
                        const float to = s.body[s.index(i + q.x, j + q.y, k + q.z)];
                        if ((from > 0.5f) == (to > 0.5f)) continue;
                        Vector3 at{double(p.x), double(p.y), double(p.z)};
                        at[a] += (0.5 - from) / (to - from);
                        sum = sum + at;
                        ++crossings;
                    }
                }
                if (crossings == 0) continue;
                const Vector3 in_cell = sum / crossings;
                vertex[s.index(i, j, k)] = static_cast<std::int32_t>(mesh.points.size());
                mesh.points.push_back(bundle.grid.point_from_voxel(
                    {(i + in_cell.x) * step, (j + in_cell.y) * step, (k + in_cell.z) * step}));
            }
        }
    }
    // One quad per edge that the surface crosses, between the four cells around it.
    for (int k = 1; k + 1 < s.n.z; ++k) {
        for (int j = 1; j + 1 < s.n.y; ++j) {
            for (int i = 1; i + 1 < s.n.x; ++i) {
                const bool here = s.body[s.index(i, j, k)] > 0.5f;
                const Int3 at{i, j, k};
                for (int a = 0; a < 3; ++a) {
                    Int3 next = at;
                    ++next[a];
                    if (here == (s.body[s.index(next.x, next.y, next.z)] > 0.5f)) continue;
                    const int u = (a + 1) % 3, v = (a + 2) % 3;
                    std::uint32_t quad[4];
                    bool whole = true;
                    for (int c = 0; c < 4; ++c) {
                        Int3 cell = at;
                        if (c == 1 || c == 2) --cell[u];
                        if (c == 2 || c == 3) --cell[v];
                        const std::int32_t index = vertex[s.index(cell.x, cell.y, cell.z)];
                        whole = whole && index >= 0;
                        quad[c] = static_cast<std::uint32_t>(std::max(index, 0));
                    }
                    if (!whole) continue;
                    if (!here) std::swap(quad[1], quad[3]);
                    mesh.triangles.push_back({quad[0], quad[1], quad[2]});
                    mesh.triangles.push_back({quad[0], quad[2], quad[3]});
                }
            }
        }
    }
    smooth(mesh, 6);
    mesh.normals.assign(mesh.points.size(), {});
    for (const auto& t : mesh.triangles) {
        const Vector3 n =
            cross(mesh.points[t[1]] - mesh.points[t[0]], mesh.points[t[2]] - mesh.points[t[0]]);
        for (std::uint32_t p : t) mesh.normals[p] = mesh.normals[p] + n;
    }
    for (Vector3& n : mesh.normals) n = normalized(n);
    return mesh;
}

}  // namespace sonocase::runtime
