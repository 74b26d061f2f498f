// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/liver_vessels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "pipeline/anatomy/coarse_field.h"
#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline::inline anatomy {

namespace {

class Colonisation {
  public:
    Colonisation(Point3 root,
                 const std::vector<Point3>& targets,
                 const std::function<bool(Point3)>& inside,
                 const GrowVesselsOptions& options)
        : inside_(inside), options_(options), nodes_{{root, -1, 0}}, stuck_{false} {
        for (const Point3& p : targets) targets_.push_back({p, 0, distance(p, root), -1, false});
    }

    VesselTree grow() {
        constexpr std::size_t kMaxNodes = 200000;
        while (nodes_.size() <= kMaxNodes) {
            const std::size_t before = nodes_.size();
            if (!step()) break;
            find_nearest(before);
        }
        return prune();
    }

  private:
    struct Target {
        Point3 position;
        int nearest = 0;  // node
        double distance = 0;
        int served_by = -1;
        bool given_up = false;

        bool open() const { return served_by < 0 && !given_up; }
    };

    // One step of every node that a target pulls at. False: nothing has grown.
    bool step() {
        std::vector<Vector3> pull(nodes_.size());
        std::vector<int> pulls(nodes_.size(), 0);
        for (Target& t : targets_) {
            if (!t.open()) continue;
            if (t.distance < options_.reach_mm) {
                t.served_by = t.nearest;
                continue;
            }
            const auto n = static_cast<std::size_t>(t.nearest);
            if (stuck_[n]) {
                t.given_up = true;  // the shape of the organ is in the way
                continue;
            }
            pull[n] = pull[n] + normalized(t.position - nodes_[n].position);
            ++pulls[n];
        }
        bool grew = false;
        const std::size_t before = nodes_.size();
        for (std::size_t n = 0; n < before; ++n) {
            if (pulls[n] > 0) grew = extend(n, pull[n]) || grew;
        }
        return grew;
    }

    // Grows a child from node n. False if there is no room for one: the node is then stuck.
    bool extend(std::size_t n, Vector3 pull) {
        // Without some random deviation branches would be straight lines.
        const GaussianPair a = gaussian_pair_at(options_.seed, 2 * n);
        const GaussianPair b = gaussian_pair_at(options_.seed, 2 * n + 1);
        Vector3 direction = normalized(pull) + 0.18 * Vector3{a.a, a.b, b.a};
        // Inertia: vessels bend without kinks.
        if (nodes_[n].parent >= 0) {
            const auto p = static_cast<std::size_t>(nodes_[n].parent);
            direction = direction + 0.5 * normalized(nodes_[n].position - nodes_[p].position);
        }
        direction = normalized(direction);
        Point3 next = nodes_[n].position + options_.step_mm * direction;
        if (!inside_(next)) next = nodes_[n].position + options_.step_mm * normalized(pull);
        bool crowded = !inside_(next);
        for (std::size_t c = n + 1; c < nodes_.size() && !crowded; ++c) {
            // Where opposite pulls cancel, the same step again would only stack nodes.
            crowded = nodes_[c].parent == static_cast<int>(n) &&
                      distance(nodes_[c].position, next) < 0.4 * options_.step_mm;
        }
        if (crowded) {
            stuck_[n] = true;
            return false;
        }
        nodes_.push_back({next, static_cast<int>(n), 0});
        stuck_.push_back(false);
        return true;
    }

    // Considers the nodes from `first` on as the nearest of each open target.
    void find_nearest(std::size_t first) {
        for (Target& t : targets_) {
            if (!t.open()) continue;
            for (std::size_t n = first; n < nodes_.size(); ++n) {
                const double d = distance(t.position, nodes_[n].position);
                if (d < t.distance) {
                    t.distance = d;
                    t.nearest = static_cast<int>(n);
                }
            }
        }
    }

    // The tree with radii, without pieces below the minimum radius.
    VesselTree prune() const {
        std::vector<double> served(nodes_.size(), 0);  // targets of the node and all below it
        for (const Target& t : targets_) {
            if (t.served_by >= 0) served[t.served_by] += 1;
        }
        for (std::size_t n = nodes_.size(); n-- > 1;) served[nodes_[n].parent] += served[n];
        VesselTree tree;
        const double all = std::max(served[0], 1.0);
        std::vector<int> kept(nodes_.size(), -1);  // index in the tree
        for (std::size_t n = 0; n < nodes_.size(); ++n) {
            const double radius = options_.root_radius_mm * std::cbrt(served[n] / all);
            if (n > 0 && (radius < options_.min_radius_mm || kept[nodes_[n].parent] < 0)) continue;
            kept[n] = static_cast<int>(tree.nodes.size());
            tree.nodes.push_back({nodes_[n].position, n > 0 ? kept[nodes_[n].parent] : -1,
                                  n > 0 ? radius : options_.root_radius_mm});
        }
        return tree;
    }

    const std::function<bool(Point3)>& inside_;
    const GrowVesselsOptions& options_;
    std::vector<VesselNode> nodes_;
    std::vector<bool> stuck_;  // # nodes: cannot grow another child
    std::vector<Target> targets_;
};

}  // namespace

VesselTree grow_vessels(Point3 root,
                        const std::vector<Point3>& targets,
                        const std::function<bool(Point3)>& inside,
                        const GrowVesselsOptions& options) {
    return Colonisation(root, targets, inside, options).grow();
}

namespace {

constexpr double kLumenDb = -26;  // blood re liver, less what the beam's thickness adds to it
constexpr double kWallDb = 7;
constexpr double kWallMm = 1.1;
// Thinner vessels would be chains of single dark voxels, which no living liver shows: to have
// edges, a tube needs four voxels of 1 mm, the size at which offsets are kept.
constexpr double kMinRadiusMm = 2.2;

bool has_word(const LabelVolume& labels, const std::vector<LabelFacts>& facts, const char* word) {
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        if (facts[l].count > 0 && labels.labels[l].name.find(word) != std::string::npos)
            return true;
    }
    return false;
}

// Largest label that `wanted` accepts, or 0.
template <class Wanted>
int largest_label(const std::vector<LabelFacts>& facts, const Wanted& wanted) {
    int best = 0;
    for (std::size_t l = 1; l < facts.size(); ++l) {
        if (wanted(l) && (best == 0 || facts[l].count > facts[best].count))
            best = static_cast<int>(l);
    }
    return best;
}

int find_label(const LabelVolume& labels, const std::vector<LabelFacts>& facts, const char* word) {
    return largest_label(facts, [&](std::size_t l) {
        return facts[l].count > 0 && labels.labels[l].name.find(word) != std::string::npos;
    });
}

struct TreeKind {
    const char* name;
    const char* root_label;
    std::initializer_list<const char*> present;  // labels that already are this tree
    double root_radius_mm;
    bool bright_wall;
    Vector3 fallback;  // root without its label, in spreads from the mean of the liver
};
const TreeKind kKinds[] = {
    {"portal",
     "portal_vein",
     {"liver_vessel", "portal_branch", "hepatic_vessel"},
     5.5,
     true,
     {0, 0, -0.8}},
    {"hepatic",
     "inferior_vena_cava",
     {"liver_vessel", "hepatic_vein", "hepatic_vessel"},
     5.0,
     false,
     {0, -0.6, 0.9}},
};

class Liver {
  public:
    Liver(const LabelVolume& labels, const LabelFacts& facts, int label)
        : labels_(labels),
          facts_(facts),
          label_(label),
          voxel_mm_(labels.grid.spacing_mm.x),
          volume_ml_(static_cast<double>(facts.count) * labels.grid.voxel_volume_mm3() / 1000) {}

    double volume_ml() const { return volume_ml_; }

    // The depth inside the liver keeps vessels away from its capsule. Before the functions below.
    void measure_depth() {
        const int step = std::max(1, static_cast<int>(std::lround(2 / voxel_mm_)));
        const Int3 lower{facts_.lower.x - 2 * step, facts_.lower.y - 2 * step,
                         facts_.lower.z - 2 * step};
        const Int3 extent{facts_.upper.x + 2 * step - lower.x + 1,
                          facts_.upper.y + 2 * step - lower.y + 1,
                          facts_.upper.z + 2 * step - lower.z + 1};
        depth_ = {lower,
                  {lower.x + extent.x - 1, lower.y + extent.y - 1, lower.z + extent.z - 1},
                  distance_inside(extent, step, [&](int i, int j, int k) {
                      return holds(i + lower.x, j + lower.y, k + lower.z);
                  })};
    }

    bool inside(Point3 mm) const {
        const Point3 v = labels_.grid.voxel_from_point(mm);
        const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
                  k = static_cast<int>(std::lround(v.z));
        return holds(i, j, k) && depth_.at(i, j, k) * voxel_mm_ > 2.5;
    }

    // The point of the liver nearest to the labelled vessel (every second voxel of it), or to the
    // fallback without one. Empty for a liver too thin for a root.
    std::optional<Point3> find_root(int vessel,
                                    const LabelFacts* vessel_facts,
                                    Vector3 fallback) const {
        std::vector<Point3> ends;
        if (vessel > 0) {
            const LabelFacts& v = *vessel_facts;
            for (int k = v.lower.z; k <= v.upper.z; k += 2) {
                for (int j = v.lower.y; j <= v.upper.y; j += 2) {
                    for (int i = v.lower.x; i <= v.upper.x; i += 2) {
                        if (labels_.voxels[labels_.grid.index(i, j, k)] == vessel)
                            ends.push_back(centre(i, j, k));
                    }
                }
            }
        }
        if (ends.empty()) {
            ends.push_back(
                labels_.grid.point_from_voxel({facts_.mean.x + fallback.x * facts_.spread.x,
                                               facts_.mean.y + fallback.y * facts_.spread.x,
                                               facts_.mean.z + fallback.z * facts_.spread.x}));
        }
        std::optional<Point3> root;
        double best = std::numeric_limits<double>::max();
        for (int k = facts_.lower.z; k <= facts_.upper.z; k += 3) {
            for (int j = facts_.lower.y; j <= facts_.upper.y; j += 3) {
                for (int i = facts_.lower.x; i <= facts_.upper.x; i += 3) {
                    if (!holds(i, j, k) || depth_.at(i, j, k) * voxel_mm_ < 5) continue;
                    const Point3 p = centre(i, j, k);
                    for (std::size_t e = 0; e < ends.size(); e += 1 + ends.size() / 64) {
                        const double d = distance(p, ends[e]);
                        if (d < best) {
                            best = d;
                            root = p;
                        }
                    }
                }
            }
        }
        return root;
    }

    // Random points inside. One target per 1.6 ml: a tree with a root of 5.5 mm then has four or
    // five targets per leaf of 0.9 mm.
    std::vector<Point3> scatter_targets(std::uint64_t stream) const {
        std::vector<Point3> targets;
        const auto wanted =
            static_cast<std::size_t>(std::clamp(static_cast<int>(volume_ml_ / 1.6), 30, 1200));
        const Int3 lower = facts_.lower, upper = facts_.upper;
        for (std::uint64_t c = 0; targets.size() < wanted && c < 60000; ++c) {
            const Point3 v{lower.x + uniform_at(stream, 3 * c) * (upper.x - lower.x),
                           lower.y + uniform_at(stream, 3 * c + 1) * (upper.y - lower.y),
                           lower.z + uniform_at(stream, 3 * c + 2) * (upper.z - lower.z)};
            const Point3 p = labels_.grid.point_from_voxel(v);
            if (inside(p)) targets.push_back(p);
        }
        return targets;
    }

  private:
    bool holds(int i, int j, int k) const {
        return labels_.grid.contains(i, j, k) &&
               labels_.voxels[labels_.grid.index(i, j, k)] == label_;
    }
    Point3 centre(int i, int j, int k) const {
        return labels_.grid.point_from_voxel(
            {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
    }

    const LabelVolume& labels_;
    const LabelFacts& facts_;
    int label_;
    double voxel_mm_, volume_ml_;
    LocalField depth_;  // voxels
};

// One piece of a vessel: a tube whose radius changes evenly from a to b. Voxel coordinates.
struct Piece {
    Point3 a, b;
    double radius_a, radius_b;

    Piece(const Grid& grid, const VesselNode& from, const VesselNode& node)
        : a(grid.voxel_from_point(from.position)),
          b(grid.voxel_from_point(node.position)),
          // The parent's piece ends with this radius.
          radius_a(std::min(from.radius_mm, 1.25 * node.radius_mm) / grid.spacing_mm.x),
          radius_b(node.radius_mm / grid.spacing_mm.x) {}

    // body(i, j, k, distance) for the voxels within `margin` of the tube's surface, distance from
    // it, negative inside.
    template <class Body>
    void each_voxel(double margin, const Body& body) const {
        const double reach = std::max(radius_a, radius_b) + margin + 1;
        const Vector3 line = b - a;
        const double length2 = std::max(dot(line, line), 1e-9);
        const auto first = [&](double u, double v) {
            return static_cast<int>(std::floor(std::min(u, v) - reach));
        };
        const auto last = [&](double u, double v) {
            return static_cast<int>(std::ceil(std::max(u, v) + reach));
        };
        for (int k = first(a.z, b.z); k <= last(a.z, b.z); ++k) {
            for (int j = first(a.y, b.y); j <= last(a.y, b.y); ++j) {
                for (int i = first(a.x, b.x); i <= last(a.x, b.x); ++i) {
                    const Vector3 p = Point3{static_cast<double>(i), static_cast<double>(j),
                                             static_cast<double>(k)} -
                                      a;
                    const double t = std::clamp(dot(p, line) / length2, 0.0, 1.0);
                    body(i, j, k, norm(p - t * line) - (radius_a + t * (radius_b - radius_a)));
                }
            }
        }
    }
};

}  // namespace

std::vector<VesselTree> grow_liver_vessels(const LabelVolume& labels,
                                           const std::vector<LabelFacts>& facts,
                                           std::uint64_t seed) {
    std::vector<VesselTree> trees;
    const int label =
        largest_label(facts, [&](std::size_t l) { return facts[l].role == StructureRole::liver; });
    if (label == 0) return trees;
    Liver liver(labels, facts[label], label);
    if (liver.volume_ml() < 20) return trees;
    liver.measure_depth();
    std::uint64_t stream = derive_seed(seed, 0x11E7);
    for (const TreeKind& kind : kKinds) {
        stream = mix_bits(stream);
        if (std::any_of(kind.present.begin(), kind.present.end(),
                        [&](const char* word) { return has_word(labels, facts, word); }))
            continue;
        const int vessel = find_label(labels, facts, kind.root_label);
        const std::optional<Point3> root = liver.find_root(vessel, &facts[vessel], kind.fallback);
        if (!root) continue;
        GrowVesselsOptions options;
        options.root_radius_mm =
            kind.root_radius_mm * std::clamp(std::cbrt(liver.volume_ml() / 1300), 0.5, 1.2);
        options.seed = mix_bits(stream);
        VesselTree tree = grow_vessels(
            *root, liver.scatter_targets(stream), [&](Point3 p) { return liver.inside(p); },
            options);
        tree.name = kind.name;
        tree.bright_wall = kind.bright_wall;
        trees.push_back(std::move(tree));
    }
    return trees;
}

void draw_vessels(const LabelVolume& labels,
                  int liver,
                  const std::vector<VesselTree>& trees,
                  std::vector<std::int8_t>& offsets) {
    const double voxel_mm = labels.grid.spacing_mm.x;
    // Walls first: the lumen of a branch then opens the walls where branches part.
    for (const bool walls : {true, false}) {
        for (const VesselTree& tree : trees) {
            if (walls && !tree.bright_wall) continue;
            for (const VesselNode& node : tree.nodes) {
                if (node.parent < 0 || node.radius_mm < kMinRadiusMm) continue;
                const Piece piece(labels.grid, tree.nodes[node.parent], node);
                piece.each_voxel(
                    walls ? kWallMm / voxel_mm : 0, [&](int i, int j, int k, double d) {
                        if (!labels.grid.contains(i, j, k)) return;
                        const std::size_t at = labels.grid.index(i, j, k);
                        if (labels.voxels[at] != liver) return;
                        const double old = offsets[at] / 4.0;
                        double db = old;
                        if (walls) {
                            const double w = std::clamp(kWallMm / voxel_mm + 0.5 - d, 0.0, 1.0);
                            db = std::max(old, old + w * (kWallDb - old));
                        } else {
                            const double w = std::clamp(0.5 - d, 0.0, 1.0);
                            db = std::min(old, old + w * (kLumenDb - old));
                        }
                        offsets[at] = static_cast<std::int8_t>(4 * std::lround(db));
                    });
            }
        }
    }
}

}  // namespace sonocase::pipeline::inline anatomy
