// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/mend_mesh.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <vector>

namespace sonocase::pipeline::inline import_mesh {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

std::uint64_t pair_key(std::uint32_t a, std::uint32_t b) {
    return static_cast<std::uint64_t>(a) << 32 | b;
}
std::uint64_t edge_key(std::uint32_t a, std::uint32_t b) {
    return pair_key(std::min(a, b), std::max(a, b));
}

struct CellHash {
    std::size_t operator()(const std::array<std::int64_t, 3>& c) const {
        return static_cast<std::size_t>(c[0] * 73856093 ^ c[1] * 19349663 ^ c[2] * 83492791);
    }
};

// For each point, the first point within weld_mm of it.
std::vector<std::uint32_t> welded(const std::vector<Point3>& points, double weld_mm) {
    std::unordered_map<std::array<std::int64_t, 3>, std::vector<std::uint32_t>, CellHash> cells;
    std::vector<std::uint32_t> first(points.size());
    const double cell_mm = std::max(weld_mm, 1e-9);
    for (std::uint32_t n = 0; n < points.size(); ++n) {
        std::array<std::int64_t, 3> at;
        for (int axis = 0; axis < 3; ++axis)
            at[axis] = static_cast<std::int64_t>(std::floor(points[n][axis] / cell_mm));
        first[n] = n;
        for (int c = 0; c < 27 && first[n] == n; ++c) {
            const auto found =
                cells.find({at[0] + c % 3 - 1, at[1] + c / 3 % 3 - 1, at[2] + c / 9 - 1});
            if (found == cells.end()) continue;
            for (const std::uint32_t other : found->second)
                if (distance(points[other], points[n]) <= weld_mm) {
                    first[n] = other;
                    break;
                }
        }
        if (first[n] == n) cells[at].push_back(n);
    }
    return first;
}

std::vector<Triangle> welded_triangles(const Surface& patches, double weld_mm) {
    const std::vector<std::uint32_t> first = welded(patches.points, weld_mm);
    std::vector<Triangle> triangles;
    std::set<Triangle> seen;
    for (const auto& t : patches.triangles) {
        const Triangle w{first[t[0]], first[t[1]], first[t[2]]};
        if (w[0] == w[1] || w[1] == w[2] || w[2] == w[0]) continue;
        // The same triangle the other way round is the neighbour's face: both stay.
        Triangle turned = w;
        std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
        if (seen.insert(turned).second) triangles.push_back(w);
    }
    return triangles;
}

// Turns triangles to agree with their neighbours. Returns the component of each.
std::vector<int> orient(std::vector<Triangle>& triangles, int* components) {
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> of_edge;
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
        for (std::size_t e = 0; e < 3; ++e)
            of_edge[edge_key(triangles[t][e], triangles[t][(e + 1) % 3])].push_back(t);
    std::vector<int> component(triangles.size(), -1);
    *components = 0;
    std::vector<std::uint32_t> stack;
    for (std::uint32_t start = 0; start < triangles.size(); ++start) {
        if (component[start] >= 0) continue;
        component[start] = *components;
        stack.assign(1, start);
        while (!stack.empty()) {
            const std::uint32_t t = stack.back();
            stack.pop_back();
            for (std::size_t e = 0; e < 3; ++e) {
                const std::uint32_t a = triangles[t][e], b = triangles[t][(e + 1) % 3];
                const auto& sharing = of_edge[edge_key(a, b)];
                if (sharing.size() != 2) continue;  // a border, or three that meet
                const std::uint32_t other = sharing[0] == t ? sharing[1] : sharing[0];
                if (component[other] >= 0) continue;
                component[other] = *components;
                Triangle& o = triangles[other];
                for (std::size_t f = 0; f < 3; ++f)
                    if (o[f] == a && o[(f + 1) % 3] == b) {  // the same way round: it disagrees
                        std::swap(o[0], o[1]);
                        break;
                    }
                stack.push_back(other);
            }
        }
        ++*components;
    }
    return component;
}

// Directed edges without an opposite one, joined to chains.
std::vector<std::vector<std::uint32_t>> border_chains(const std::vector<Triangle>& triangles) {
    std::unordered_map<std::uint64_t, int> balance;
    for (const Triangle& t : triangles)
        for (std::size_t e = 0; e < 3; ++e) {
            ++balance[pair_key(t[e], t[(e + 1) % 3])];
            --balance[pair_key(t[(e + 1) % 3], t[e])];
        }
    // In the order of the triangles, so that the result does not depend on hashing.
    std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> next;
    std::vector<std::uint32_t> starts;
    for (const Triangle& t : triangles)
        for (std::size_t e = 0; e < 3; ++e) {
            const std::uint32_t a = t[e], b = t[(e + 1) % 3];
            int& left = balance[pair_key(a, b)];
            if (left <= 0) continue;
            --left;
            next[a].push_back(b);
            starts.push_back(a);
        }
    std::vector<std::vector<std::uint32_t>> chains;
    for (const std::uint32_t start : starts) {
        std::vector<std::uint32_t> chain{start};
        std::unordered_map<std::uint32_t, std::size_t> place{{start, 0}};
        while (!next[chain.back()].empty()) {
            const std::uint32_t to = next[chain.back()].back();
            next[chain.back()].pop_back();
            const auto seen = place.find(to);
            if (seen == place.end()) {
                place[to] = chain.size();
                chain.push_back(to);
                continue;
            }
            // A loop closes at `to`; what came before it goes on from there.
            const std::size_t from = seen->second;
            std::vector<std::uint32_t> loop(chain.begin() + static_cast<std::ptrdiff_t>(from),
                                            chain.end());
            loop.push_back(to);
            chains.push_back(std::move(loop));
            for (std::size_t n = from + 1; n < chain.size(); ++n) place.erase(chain[n]);
            chain.resize(from + 1);
        }
        if (chain.size() > 1) chains.push_back(std::move(chain));
    }
    return chains;
}

// Whether the triangles of each component leave no edge without its opposite. Cost: n log n,
// however many components there are.
std::vector<bool> closed_components(const std::vector<Triangle>& triangles,
                                    const std::vector<int>& component,
                                    int count) {
    struct Side {
        int component;
        std::uint64_t edge;
        int sense;
    };
    std::vector<Side> sides;
    sides.reserve(3 * triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t)
        for (std::size_t e = 0; e < 3; ++e) {
            const std::uint32_t a = triangles[t][e], b = triangles[t][(e + 1) % 3];
            sides.push_back({component[t], edge_key(a, b), a < b ? 1 : -1});
        }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
        return a.component != b.component ? a.component < b.component : a.edge < b.edge;
    });
    std::vector<bool> closed(count, true);
    for (std::size_t n = 0; n < sides.size();) {
        const Side& first = sides[n];
        int sum = 0;
        for (; n < sides.size() && sides[n].component == first.component &&
               sides[n].edge == first.edge;
             ++n)
            sum += sides[n].sense;
        if (sum != 0) closed[first.component] = false;
    }
    return closed;
}

double signed_volume(const std::vector<Point3>& points, const Triangle& t) {
    const Vector3 a = points[t[0]] - Point3{}, b = points[t[1]] - Point3{},
                  c = points[t[2]] - Point3{};
    return dot(a, cross(b, c)) / 6;
}

void cap_borders(Surface& surface, MendReport& report) {
    for (const auto& chain : border_chains(surface.triangles)) {
        if (chain.front() != chain.back() || chain.size() < 4) {
            ++report.open_loops;
            continue;
        }
        Vector3 middle;
        double length_mm = 0;
        for (std::size_t n = 0; n + 1 < chain.size(); ++n) {
            middle = middle + (surface.points[chain[n]] - Point3{});
            length_mm += distance(surface.points[chain[n]], surface.points[chain[n + 1]]);
        }
        middle = (1 / static_cast<double>(chain.size() - 1)) * middle;
        const auto hub = static_cast<std::uint32_t>(surface.points.size());
        surface.points.push_back(Point3{} + middle);
        for (std::size_t n = 0; n + 1 < chain.size(); ++n)
            surface.triangles.push_back({chain[n + 1], chain[n], hub});
        ++report.caps;
        report.longest_cap_mm = std::max(report.longest_cap_mm, length_mm);
    }
}

}  // namespace

Surface mend_mesh(const Surface& patches, const MendOptions& options, MendReport* report) {
    Surface solid;
    solid.points = patches.points;
    solid.triangles = welded_triangles(patches, options.weld_mm);
    MendReport out;
    orient(solid.triangles, &out.components);
    cap_borders(solid, out);
    const std::vector<int> component = orient(solid.triangles, &out.components);
    // A part that only borders on others has no inside of its own, and stays as it is.
    const std::vector<bool> closed = closed_components(solid.triangles, component, out.components);
    std::vector<double> volume(out.components, 0.0);
    for (std::size_t t = 0; t < solid.triangles.size(); ++t)
        volume[component[t]] += signed_volume(solid.points, solid.triangles[t]);
    for (std::size_t t = 0; t < solid.triangles.size(); ++t)
        if (const auto c = static_cast<std::size_t>(component[t]); closed[c] && volume[c] < 0)
            std::swap(solid.triangles[t][0], solid.triangles[t][1]);
    for (std::size_t c = 0; c < volume.size(); ++c) {
        out.turned += closed[c] && volume[c] < 0;
        out.volume_ml += (closed[c] ? std::abs(volume[c]) : volume[c]) / 1000;
    }
    if (report != nullptr) *report = out;
    return solid;
}

}  // namespace sonocase::pipeline::inline import_mesh
