// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/centreline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <queue>
#include <utility>

namespace sonocase::pipeline::inline flow {
namespace {

constexpr double kSpurRadii = 3, kMiddleReach = 2.5;
constexpr std::size_t kMaxLines = 200;

// The voxels of a part as a graph of 26 neighbours.
class VoxelGraph {
  public:
    explicit VoxelGraph(const VesselPart& part) : part_(part) {
        const Grid& grid = part.grid;
        const auto x = static_cast<std::ptrdiff_t>(grid.size.x),
                   y = static_cast<std::ptrdiff_t>(grid.size.y);
        for (int q = 0; q < 27; ++q) {
            const int i = q % 3 - 1, j = q / 3 % 3 - 1, k = q / 9 - 1;
            if (q == 13) continue;
            offset_.push_back(i + x * (j + y * k));
            length_.push_back(
                std::hypot(i * grid.spacing_mm.x, j * grid.spacing_mm.y, k * grid.spacing_mm.z));
        }
        number_.assign(part.label.size(), -1);
        for (std::size_t v = 0; v < part.label.size(); ++v) {
            if (part.label[v] == 0) continue;
            number_[v] = static_cast<std::int32_t>(voxel_.size());
            voxel_.push_back(v);
        }
    }
    std::size_t size() const { return voxel_.size(); }
    Point3 place(std::size_t v) const {
        const std::size_t at = voxel_[v], x = part_.grid.size.x, y = part_.grid.size.y,
                          j = at / x % y, k = at / x / y;
        return part_.grid.point_from_voxel(
            {static_cast<double>(at % x), static_cast<double>(j), static_cast<double>(k)});
    }
    // visit(neighbour, length): -1 for one outside the vessel, -2 for one beyond the map.
    template <class Visit>
    void each_neighbour(std::size_t v, Visit visit) const {
        for (std::size_t q = 0; q < offset_.size(); ++q) {
            const std::size_t at = voxel_[v] + offset_[q];
            visit(part_.beyond[at] != 0 ? -2 : number_[at], length_[q]);
        }
    }

  private:
    const VesselPart& part_;
    std::vector<std::ptrdiff_t> offset_;
    std::vector<double> length_;
    std::vector<std::int32_t> number_;
    std::vector<std::size_t> voxel_;
};

using Step = std::pair<double, std::size_t>;
using Queue = std::priority_queue<Step, std::vector<Step>, std::greater<>>;

// Distance to the wall along the graph's edges, mm: within 8 % of the straight one.
std::vector<double> wall_distance(const VoxelGraph& graph, double voxel_mm) {
    std::vector<double> d(graph.size(), 1e30);
    Queue open;
    for (std::size_t v = 0; v < graph.size(); ++v) {
        double nearest = 1e30;
        graph.each_neighbour(v, [&](std::int32_t n, double length) {
            if (n == -1) nearest = std::min(nearest, length - 0.5 * voxel_mm);
        });
        if (nearest < 1e29) {
            d[v] = nearest;
            open.push({nearest, v});
        }
    }
    while (!open.empty()) {
        const auto [at, v] = open.top();
        open.pop();
        if (at > d[v]) continue;
        graph.each_neighbour(v, [&, from = at](std::int32_t n, double length) {
            if (n < 0) return;
            const std::size_t next = n;
            if (from + length < d[next]) {
                d[next] = from + length;
                open.push({d[next], next});
            }
        });
    }
    return d;
}

// The wall distance of the middle near each voxel: of the thickest place that is near for its own
// width. A flat vessel's edge is farther from its middle than the middle is from the wall.
std::vector<double> middle_distance(const VoxelGraph& graph, const std::vector<double>& d) {
    std::vector<std::size_t> order(graph.size()), middle(graph.size());
    for (std::size_t v = 0; v < order.size(); ++v) order[v] = middle[v] = v;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return d[a] > d[b]; });
    for (const std::size_t v : order) {
        const Point3 here = graph.place(v);
        graph.each_neighbour(v, [&](std::int32_t n, double) {
            if (n < 0) return;
            const std::size_t candidate = middle[n];
            if (d[candidate] > d[middle[v]] &&
                distance(here, graph.place(candidate)) < kMiddleReach * d[candidate])
                middle[v] = candidate;
        });
    }
    std::vector<double> out(graph.size());
    for (std::size_t v = 0; v < out.size(); ++v) out[v] = d[middle[v]];
    return out;
}

// The smallest cost and length from the lines so far to every voxel; lowered as lines are added.
class Reach {
  public:
    explicit Reach(const VoxelGraph& graph, std::vector<double> price)
        : graph_(graph),
          price_(std::move(price)),
          cost_(graph.size(), 1e30),
          length_mm_(graph.size(), 1e30),
          parent_(graph.size(), -1) {}

    void add(const std::vector<std::size_t>& line) {
        spread(
            line, cost_,
            [&](std::size_t from, std::size_t to, double length) {
                return length * 0.5 * (price_[from] + price_[to]);
            },
            true);
        spread(
            line, length_mm_, [](std::size_t, std::size_t, double length) { return length; },
            false);
    }
    const std::vector<double>& length_mm() const { return length_mm_; }  // from the nearest line
    // The path from a voxel to the line that it joins.
    std::vector<std::size_t> path_from(std::size_t end) const {
        std::vector<std::size_t> path{end};
        while (cost_[path.back()] > 0) path.push_back(parent_[path.back()]);
        return path;
    }

  private:
    template <class Price>
    void spread(const std::vector<std::size_t>& line,
                std::vector<double>& value,
                Price price,
                bool parents) {
        Queue open;
        for (const std::size_t v : line) {
            if (value[v] == 0) continue;
            value[v] = 0;
            open.push({0, v});
        }
        while (!open.empty()) {
            const auto [at, v] = open.top();
            open.pop();
            if (at > value[v]) continue;
            graph_.each_neighbour(v, [&, from = at, here = v](std::int32_t n, double length) {
                if (n < 0) return;
                const std::size_t next = n;
                const double to = from + price(here, next, length);
                if (to >= value[next]) return;
                value[next] = to;
                if (parents) parent_[next] = static_cast<std::int32_t>(here);
                open.push({to, next});
            });
        }
    }
    const VoxelGraph& graph_;
    std::vector<double> price_, cost_, length_mm_;
    std::vector<std::int32_t> parent_;
};

// Cuts the tree of paths at forks and ends.
CentreTree tree_of(const VoxelGraph& graph,
                   const std::vector<double>& d,
                   const std::vector<std::vector<std::size_t>>& paths) {
    std::map<std::size_t, std::vector<std::size_t>> links;  // of each voxel on a line
    for (const auto& path : paths)
        for (std::size_t i = 0; i + 1 < path.size(); ++i) {
            links[path[i]].push_back(path[i + 1]);
            links[path[i + 1]].push_back(path[i]);
        }
    CentreTree tree;
    std::map<std::size_t, int> node_of;
    for (const auto& [v, ends] : links) {
        if (ends.size() == 2) continue;
        node_of[v] = static_cast<int>(tree.nodes.size());
        CentreNode node{graph.place(v), d[v], static_cast<int>(ends.size()), false};
        graph.each_neighbour(v, [&](std::int32_t n, double) { node.cut |= n == -2; });
        tree.nodes.push_back(node);
    }
    for (const auto& [from, number] : node_of) {
        for (const std::size_t step : links[from]) {
            std::vector<std::size_t> walk{from, step};
            while (node_of.find(walk.back()) == node_of.end()) {
                const auto& ends = links[walk.back()];
                walk.push_back(ends[0] == walk[walk.size() - 2] ? ends[1] : ends[0]);
            }
            // Each line is met from both its ends.
            if (std::pair(walk.front(), walk[1]) > std::pair(walk.back(), walk[walk.size() - 2]))
                continue;
            CentreLine line;
            line.first = number;
            line.last = node_of[walk.back()];
            for (const std::size_t v : walk) {
                line.points.push_back(graph.place(v));
                line.radius_mm.push_back(d[v]);
            }
            tree.lines.push_back(std::move(line));
        }
    }
    return tree;
}

double length_of(const CentreLine& line) {
    double sum = 0;
    for (std::size_t i = 0; i + 1 < line.points.size(); ++i)
        sum += distance(line.points[i], line.points[i + 1]);
    return sum;
}

// Appends `more` to the end of the line that lies at `node`.
void go_on(CentreLine& line, int node, CentreLine more, int to) {
    const auto turn = [](CentreLine& l) {
        std::swap(l.first, l.last);
        std::reverse(l.points.begin(), l.points.end());
        std::reverse(l.radius_mm.begin(), l.radius_mm.end());
    };
    const bool at_first = line.first == node;
    if (at_first) turn(line);
    if (more.first != node) turn(more);
    line.points.insert(line.points.end(), more.points.begin() + 1, more.points.end());
    line.radius_mm.insert(line.radius_mm.end(), more.radius_mm.begin() + 1, more.radius_mm.end());
    line.last = to;
    if (at_first) turn(line);
}

// Joins forks that are close to each other. Two side vessels that leave a wide trunk close together
// leave a line between them that is too short to have a course: the trunk would end there.
void join_forks(double join_mm, CentreTree& tree) {
    for (std::size_t l = 0; l < tree.lines.size();) {
        const CentreLine line = tree.lines[l];
        CentreNode &kept = tree.nodes[line.first], &gone = tree.nodes[line.last];
        // A place that no wall bounds, at the map's border, has no width.
        const double thick = std::max(kept.radius_mm, gone.radius_mm),
                     near = thick < 1e29 ? std::max(join_mm, thick) : join_mm;
        if (line.first == line.last || kept.degree < 2 || gone.degree < 2 ||
            length_of(line) >= near) {
            ++l;
            continue;
        }
        tree.lines.erase(tree.lines.begin() + l);
        for (CentreLine& other : tree.lines)
            while (other.first == line.last || other.last == line.last)
                go_on(other, line.last, line, line.first);
        kept.degree += gone.degree - 2;
        gone.degree = 0;
        l = 0;
    }
}

}  // namespace

CentreTree centre_tree(const VesselPart& part, double min_mm, double join_mm) {
    const VoxelGraph graph(part);
    if (graph.size() == 0) return {};
    const Vector3 s = part.grid.spacing_mm;
    const std::vector<double> d = wall_distance(graph, std::min({s.x, s.y, s.z}));
    const std::vector<double> middle = middle_distance(graph, d);
    // What no wall bounds lies at the map's border and is not a middle.
    const auto thickest = std::max_element(d.begin(), d.end(), [](double a, double b) {
        return (a > 1e29 ? 0 : a) < (b > 1e29 ? 0 : b);
    });
    const std::size_t start = thickest - d.begin();
    std::vector<double> price(graph.size());
    for (std::size_t v = 0; v < price.size(); ++v) {
        const double off = 6 * (1 - d[v] / middle[v]);
        price[v] = 1 + off * off * off;
    }
    Reach reach(graph, std::move(price));
    reach.add({start});
    std::vector<std::vector<std::size_t>> added;
    while (added.size() < kMaxLines) {
        // The voxel farthest from all lines, beyond what the width of its own vessel explains.
        std::size_t end = start;
        double farthest = 0;
        for (std::size_t v = 0; v < graph.size(); ++v) {
            const double away = reach.length_mm()[v];
            if (away < 1e29 && away > farthest && away > min_mm && away > kSpurRadii * middle[v]) {
                farthest = away;
                end = v;
            }
        }
        if (farthest == 0) break;
        added.push_back(reach.path_from(end));
        reach.add(added.back());
    }
    CentreTree tree = tree_of(graph, d, added);
    join_forks(join_mm, tree);
    return tree;
}

}  // namespace sonocase::pipeline::inline flow
