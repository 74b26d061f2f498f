// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/vessel_tree.h"

#include <cmath>
#include <limits>

#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline {

VesselTree grow_vessels(Point3 root,
                        const std::vector<Point3>& targets,
                        const std::function<bool(Point3)>& inside,
                        const GrowVesselsOptions& options) {
    struct Target {
        Point3 position;
        int nearest = 0;
        double distance = 0;
        int served_by = -1;
        bool given_up = false;
    };
    std::vector<VesselNode> nodes{{root, -1, 0}};
    std::vector<Target> open;
    for (const Point3& p : targets) open.push_back({p, 0, distance(p, root), -1, false});
    std::vector<bool> stuck{false};

    for (bool grew = true; grew;) {
        grew = false;
        std::vector<Vector3> pull(nodes.size());
        std::vector<int> pulls(nodes.size(), 0);
        for (Target& t : open) {
            if (t.served_by >= 0 || t.given_up) continue;
            if (t.distance < options.reach_mm) {
                t.served_by = t.nearest;
                continue;
            }
            const auto n = static_cast<std::size_t>(t.nearest);
            if (stuck[n]) {
                t.given_up = true;  // the organ's shape lies between
                continue;
            }
            pull[n] = pull[n] + normalized(t.position - nodes[n].position);
            ++pulls[n];
        }
        const std::size_t before = nodes.size();
        for (std::size_t n = 0; n < before; ++n) {
            if (pulls[n] == 0) continue;
            // a little wander, or branches are ruler-straight
            const GaussianPair a = gaussian_pair_at(options.seed, 2 * n);
            const GaussianPair b = gaussian_pair_at(options.seed, 2 * n + 1);
            Vector3 direction = normalized(pull[n]) + 0.18 * Vector3{a.a, a.b, b.a};
            // and inertia: vessels bend, they do not kink
            if (nodes[n].parent >= 0) {
                const auto p = static_cast<std::size_t>(nodes[n].parent);
                direction = direction + 0.5 * normalized(nodes[n].position - nodes[p].position);
            }
            direction = normalized(direction);
            Point3 next = nodes[n].position + options.step_mm * direction;
            if (!inside(next)) {
                next = nodes[n].position + options.step_mm * normalized(pull[n]);
            }
            bool crowded = !inside(next);
            for (std::size_t c = n + 1; c < nodes.size() && !crowded; ++c) {
                // the same step again would only stack nodes: opposite pulls cancel
                crowded = nodes[c].parent == static_cast<int>(n) &&
                          distance(nodes[c].position, next) < 0.4 * options.step_mm;
            }
            if (crowded) {
                stuck[n] = true;
                continue;
            }
            nodes.push_back({next, static_cast<int>(n), 0});
            stuck.push_back(false);
            grew = true;
        }
        for (Target& t : open) {
            if (t.served_by >= 0 || t.given_up) continue;
            for (std::size_t n = before; n < nodes.size(); ++n) {
                const double d = distance(t.position, nodes[n].position);
                if (d < t.distance) {
                    t.distance = d;
                    t.nearest = static_cast<int>(n);
                }
            }
            if (t.given_up) grew = true;
        }
        if (nodes.size() > 200000) break;
    }

    std::vector<double> served(nodes.size(), 0);
    for (const Target& t : open) {
        if (t.served_by >= 0) served[static_cast<std::size_t>(t.served_by)] += 1;
    }
    for (std::size_t n = nodes.size(); n-- > 1;) {
        served[static_cast<std::size_t>(nodes[n].parent)] += served[n];
    }
    VesselTree tree;
    const double all = std::max(served[0], 1.0);
    std::vector<int> kept(nodes.size(), -1);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const double radius = options.root_radius_mm * std::cbrt(served[n] / all);
        if (n > 0 && (radius < options.least_radius_mm ||
                      kept[static_cast<std::size_t>(nodes[n].parent)] < 0))
            continue;
        kept[n] = static_cast<int>(tree.nodes.size());
        tree.nodes.push_back({nodes[n].position,
                              n > 0 ? kept[static_cast<std::size_t>(nodes[n].parent)] : -1,
                              n > 0 ? radius : options.root_radius_mm});
    }
    return tree;
}

}  // namespace sonocase::pipeline
