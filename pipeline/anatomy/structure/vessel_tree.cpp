// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure/vessel_tree.h"

#include <cmath>

#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline {
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
        constexpr std::size_t kMostNodes = 200000;
        while (nodes_.size() <= kMostNodes) {
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

    // Grows a child from node n; false, and the node is stuck, if there is no room for one.
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

    // The tree with radii, without pieces below the least radius.
    VesselTree prune() const {
        std::vector<double> served(nodes_.size(), 0);  // targets of the node and all below it
        for (const Target& t : targets_) {
            if (t.served_by >= 0) served[static_cast<std::size_t>(t.served_by)] += 1;
        }
        for (std::size_t n = nodes_.size(); n-- > 1;)
            served[static_cast<std::size_t>(nodes_[n].parent)] += served[n];
        VesselTree tree;
        const double all = std::max(served[0], 1.0);
        std::vector<int> kept(nodes_.size(), -1);  // index in the tree
        for (std::size_t n = 0; n < nodes_.size(); ++n) {
            const double radius = options_.root_radius_mm * std::cbrt(served[n] / all);
            if (n > 0 && (radius < options_.least_radius_mm ||
                          kept[static_cast<std::size_t>(nodes_[n].parent)] < 0))
                continue;
            kept[n] = static_cast<int>(tree.nodes.size());
            tree.nodes.push_back({nodes_[n].position,
                                  n > 0 ? kept[static_cast<std::size_t>(nodes_[n].parent)] : -1,
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

}  // namespace sonocase::pipeline
