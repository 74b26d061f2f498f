// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/models/skin_mesh.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sonocase::runtime::inline display_models {
namespace {

struct Samples {
    Int3 n;
    double step = 1;          // in voxels
    std::vector<float> body;  // share of the wanted labels around each sample, [0, 1]
    std::size_t index(int i, int j, int k) const {
        return i + n.x * (j + n.y * static_cast<std::size_t>(k));
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
                const std::uint32_t p = t[a];
                const std::uint32_t q = t[(a + 1) % 3];
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

Samples make_samples(const CaseBundle& bundle, double step_mm) {
    const Int3 size = bundle.label_bricks.size;
    Samples s;
    if (size.x < 2 || size.y < 2 || size.z < 2) return s;
    s.step = std::max(step_mm / bundle.grid.spacing_mm.x, 1.0);
    for (int a = 0; a < 3; ++a) s.n[a] = static_cast<int>((size[a] - 1) / s.step) + 1;
    s.body.resize(static_cast<std::size_t>(s.n.x) * s.n.y * s.n.z);
    return s;
}

// Calls use() with the labels of eight places around a sample, each a quarter step off, so that
// slanted surfaces have no steps.
template <class Use>
void for_labels_around(const CaseBundle& bundle, const Samples& s, Int3 p, const Use& use) {
    const Int3 size = bundle.label_bricks.size;
    for (int c = 0; c < 8; ++c) {
        const auto at = [&](int n, int axis, int side) {
            const double v = (n + (side ? 0.25 : -0.25)) * s.step;
            return std::clamp(static_cast<int>(v + 0.5), 0, size[axis] - 1);
        };
        use(bundle.label_bricks.at(at(p.x, 0, c & 1), at(p.y, 1, c >> 1 & 1), at(p.z, 2, c >> 2)));
    }
}

// One vertex per cell that the surface passes, in the middle of the crossed edges; the index of
// each cell's vertex, -1 where it has none.
std::vector<std::int32_t> place_vertices(const Samples& s, const Grid& grid, Surface& mesh) {
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
                mesh.points.push_back(
                    grid.point_from_voxel({(i + in_cell.x) * s.step, (j + in_cell.y) * s.step,
                                           (k + in_cell.z) * s.step}));
            }
        }
    }
    return vertex;
}

// One quad per edge that the surface crosses, between the four cells around it.
void place_quads(const Samples& s, const std::vector<std::int32_t>& vertex, Surface& mesh) {
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
}

Surface surface_nets(const Samples& s, const Grid& grid) {
    Surface mesh;
    place_quads(s, place_vertices(s, grid, mesh), mesh);
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

struct OrganColour {
    const char* part;  // of a label's name
    unsigned rgb;
};
// The first entry that fits counts.
constexpr OrganColour kOrgans[] = {
    {"gallbladder", 0x7FA650}, {"portal", 0x7C6BB5},   {"liver", 0x9C4A3C},
    {"kidney", 0xB8705A},      {"spleen", 0x84506A},   {"stomach", 0xCB8E9A},
    {"duoden", 0xD9A48C},      {"bowel", 0xD9A48C},    {"colon", 0xD9A48C},
    {"pancreas", 0xDDB45C},    {"bladder", 0xD9C26A},  {"aorta", 0xCF4B40},
    {"arter", 0xCF4B40},       {"vena", 0x5A78C8},     {"vein", 0x5A78C8},
    {"vessel", 0x5A78C8},      {"lung", 0xE3B7B4},     {"heart", 0xB2554C},
    {"rib", 0xE6DCC3},         {"vertebra", 0xE6DCC3}, {"sacrum", 0xE6DCC3},
    {"hip", 0xE6DCC3},         {"femur", 0xE6DCC3},    {"sternum", 0xE6DCC3},
    {"costal", 0xD8D2BE},      {"scapula", 0xE6DCC3},  {"clavic", 0xE6DCC3},
    {"humer", 0xE6DCC3},       {"bone", 0xE6DCC3},     {"spine", 0xE6DCC3},
    {"prostate", 0xC99A86},    {"adrenal", 0xD2A86A},
};

}  // namespace

unsigned organ_colour(const std::string& label) {
    for (const OrganColour& organ : kOrgans) {
        if (label.find(organ.part) != std::string::npos) return organ.rgb;
    }
    return 0;
}

Surface skin_mesh(const CaseBundle& bundle, double step_mm) {
    Samples s = make_samples(bundle, step_mm);
    for (int k = 0; k < s.n.z; ++k) {
        for (int j = 0; j < s.n.y; ++j) {
            for (int i = 0; i < s.n.x; ++i) {
                float& share = s.body[s.index(i, j, k)];
                for_labels_around(bundle, s, {i, j, k},
                                  [&](int label) { share += label ? 0.125f : 0; });
            }
        }
    }
    return s.body.empty() ? Surface{} : surface_nets(s, bundle.grid);
}

std::vector<OrganMesh> organ_meshes(const CaseBundle& bundle,
                                    double step_mm,
                                    const std::atomic<bool>& stop) {
    std::vector<unsigned> colours;  // one per group
    std::vector<int> group(256, -1);
    for (std::size_t label = 1; label < std::min<std::size_t>(bundle.labels.size(), 256); ++label) {
        const unsigned rgb = organ_colour(bundle.labels[label].name);
        if (rgb == 0) continue;
        const auto at = std::find(colours.begin(), colours.end(), rgb);
        group[label] = static_cast<int>(at - colours.begin());
        if (at == colours.end()) colours.push_back(rgb);
    }
    Samples s = make_samples(bundle, step_mm);
    std::vector<std::vector<std::uint8_t>> eighths(colours.size(),
                                                   std::vector<std::uint8_t>(s.body.size()));
    for (int k = 0; k < s.n.z && !stop; ++k) {
        for (int j = 0; j < s.n.y; ++j) {
            for (int i = 0; i < s.n.x; ++i) {
                const std::size_t at = s.index(i, j, k);
                for_labels_around(bundle, s, {i, j, k}, [&](int label) {
                    const int g = group[label];
                    if (g >= 0) ++eighths[g][at];
                });
            }
        }
    }
    std::vector<OrganMesh> meshes;
    for (std::size_t g = 0; g < colours.size() && !stop; ++g) {
        for (std::size_t i = 0; i < s.body.size(); ++i) s.body[i] = 0.125f * eighths[g][i];
        meshes.push_back({surface_nets(s, bundle.grid), colours[g]});
    }
    if (stop) meshes.clear();
    return meshes;
}

}  // namespace sonocase::runtime::inline display_models
