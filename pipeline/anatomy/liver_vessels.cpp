// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/anatomy/structure_scene.h"
#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline {
namespace {

constexpr double kLumenDb = -26;  // blood re liver, less what the beam's thickness fills in
constexpr double kWallDb = 7;
constexpr double kWallMm = 1.1;
constexpr double kWalledFromMm = 1.5;

bool has_word(const LabelVolume& labels, const std::vector<LabelFacts>& facts, const char* word) {
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        if (facts[l].count > 0 && labels.labels[l].name.find(word) != std::string::npos)
            return true;
    }
    return false;
}

int find_label(const LabelVolume& labels, const std::vector<LabelFacts>& facts, const char* word) {
    int best = 0;
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        if (facts[l].count > 0 && labels.labels[l].name.find(word) != std::string::npos &&
            (best == 0 || facts[l].count > facts[static_cast<std::size_t>(best)].count)) {
            best = static_cast<int>(l);
        }
    }
    return best;
}

}  // namespace

std::vector<VesselTree> grow_liver_vessels(const LabelVolume& labels,
                                           const std::vector<LabelFacts>& facts,
                                           std::uint64_t seed) {
    std::vector<VesselTree> trees;
    int liver = 0;
    for (std::size_t l = 1; l < facts.size(); ++l) {
        if (facts[l].role == StructureRole::liver &&
            (liver == 0 || facts[l].count > facts[static_cast<std::size_t>(liver)].count)) {
            liver = static_cast<int>(l);
        }
    }
    if (liver == 0) return trees;
    const LabelFacts& organ = facts[static_cast<std::size_t>(liver)];
    const double voxel_mm = labels.grid.spacing_mm.x;
    const double volume_ml =
        static_cast<double>(organ.count) * labels.grid.voxel_volume_mm3() / 1000;
    if (volume_ml < 20) return trees;

    // depth inside the liver keeps vessels away from its capsule
    const int step = std::max(1, static_cast<int>(std::lround(2 / voxel_mm)));
    const Int3 lower{organ.lower.x - 2 * step, organ.lower.y - 2 * step, organ.lower.z - 2 * step};
    const Int3 extent{organ.upper.x + 2 * step - lower.x + 1,
                      organ.upper.y + 2 * step - lower.y + 1,
                      organ.upper.z + 2 * step - lower.z + 1};
    const auto is_liver = [&](int i, int j, int k) {
        return labels.grid.contains(i, j, k) && labels.voxels[labels.grid.index(i, j, k)] == liver;
    };
    const LocalField depth{lower,
                           {lower.x + extent.x - 1, lower.y + extent.y - 1, lower.z + extent.z - 1},
                           distance_inside(extent, step, [&](int i, int j, int k) {
                               return is_liver(i + lower.x, j + lower.y, k + lower.z);
                           })};
    const auto inside = [&](Point3 mm) {
        const Point3 v = labels.grid.voxel_from_point(mm);
        const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
                  k = static_cast<int>(std::lround(v.z));
        return is_liver(i, j, k) && depth.at(i, j, k) * voxel_mm > 2.5;
    };

    struct Kind {
        const char* name;
        const char* root_label;
        std::initializer_list<const char*> present;  // labels that already are this tree
        double root_radius_mm;
        bool bright_wall;
        Vector3 fallback;  // where the root is without its label, in spreads from the middle
    };
    const Kind kinds[] = {
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
    std::uint64_t stream = derive_seed(seed, 0x11E7);
    for (const Kind& kind : kinds) {
        stream = mix_bits(stream);
        if (std::any_of(kind.present.begin(), kind.present.end(),
                        [&](const char* word) { return has_word(labels, facts, word); }))
            continue;
        // Root: the place inside the liver that is nearest to the labelled vessel.
        const int vessel = find_label(labels, facts, kind.root_label);
        Point3 goal =
            labels.grid.point_from_voxel({organ.mean.x + kind.fallback.x * organ.spread.x,
                                          organ.mean.y + kind.fallback.y * organ.spread.x,
                                          organ.mean.z + kind.fallback.z * organ.spread.x});
        std::vector<Point3> ends;
        if (vessel > 0) {
            const LabelFacts& v = facts[static_cast<std::size_t>(vessel)];
            for (int k = v.lower.z; k <= v.upper.z; k += 2) {
                for (int j = v.lower.y; j <= v.upper.y; j += 2) {
                    for (int i = v.lower.x; i <= v.upper.x; i += 2) {
                        if (labels.voxels[labels.grid.index(i, j, k)] == vessel) {
                            ends.push_back(labels.grid.point_from_voxel({static_cast<double>(i),
                                                                         static_cast<double>(j),
                                                                         static_cast<double>(k)}));
                        }
                    }
                }
            }
        }
        if (ends.empty()) ends.push_back(goal);
        Point3 root = goal;
        double best = std::numeric_limits<double>::max();
        for (int k = organ.lower.z; k <= organ.upper.z; k += 3) {
            for (int j = organ.lower.y; j <= organ.upper.y; j += 3) {
                for (int i = organ.lower.x; i <= organ.upper.x; i += 3) {
                    if (!is_liver(i, j, k) || depth.at(i, j, k) * voxel_mm < 5) continue;
                    const Point3 p = labels.grid.point_from_voxel(
                        {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
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
        if (best == std::numeric_limits<double>::max()) continue;
        // One target to about 1.6 ml: leaves of 0.9 mm under a root of 5.5 mm serve 4 to 5 each.
        std::vector<Point3> targets;
        const int wanted = std::clamp(static_cast<int>(volume_ml / 1.6), 30, 1200);
        for (std::uint64_t c = 0; targets.size() < static_cast<std::size_t>(wanted) && c < 60000;
             ++c) {
            const Point3 v{
                organ.lower.x + uniform_at(stream, 3 * c) * (organ.upper.x - organ.lower.x),
                organ.lower.y + uniform_at(stream, 3 * c + 1) * (organ.upper.y - organ.lower.y),
                organ.lower.z + uniform_at(stream, 3 * c + 2) * (organ.upper.z - organ.lower.z)};
            const Point3 p = labels.grid.point_from_voxel(v);
            if (inside(p)) targets.push_back(p);
        }
        GrowVesselsOptions options;
        options.root_radius_mm =
            kind.root_radius_mm * std::clamp(std::cbrt(volume_ml / 1300), 0.5, 1.2);
        options.seed = mix_bits(stream);
        VesselTree tree = grow_vessels(root, targets, inside, options);
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
    // Walls first, so that no wall is left standing in the lumen where branches part.
    for (const bool walls : {true, false}) {
        for (const VesselTree& tree : trees) {
            if (walls && !tree.bright_wall) continue;
            for (const VesselNode& node : tree.nodes) {
                if (node.parent < 0) continue;
                const VesselNode& from = tree.nodes[static_cast<std::size_t>(node.parent)];
                if (walls && node.radius_mm < kWalledFromMm) continue;
                const Point3 a = labels.grid.voxel_from_point(from.position);
                const Point3 b = labels.grid.voxel_from_point(node.position);
                // radius of the parent's piece at its end, so that the tube narrows evenly
                const double ra = std::min(from.radius_mm, 1.25 * node.radius_mm) / voxel_mm;
                const double rb = node.radius_mm / voxel_mm;
                const double reach = std::max(ra, rb) + (walls ? kWallMm / voxel_mm : 0) + 1;
                const Vector3 line = b - a;
                const double length2 = std::max(dot(line, line), 1e-9);
                for (int k = static_cast<int>(std::floor(std::min(a.z, b.z) - reach));
                     k <= static_cast<int>(std::ceil(std::max(a.z, b.z) + reach)); ++k) {
                    for (int j = static_cast<int>(std::floor(std::min(a.y, b.y) - reach));
                         j <= static_cast<int>(std::ceil(std::max(a.y, b.y) + reach)); ++j) {
                        for (int i = static_cast<int>(std::floor(std::min(a.x, b.x) - reach));
                             i <= static_cast<int>(std::ceil(std::max(a.x, b.x) + reach)); ++i) {
                            if (!labels.grid.contains(i, j, k)) continue;
                            const std::size_t at = labels.grid.index(i, j, k);
                            if (labels.voxels[at] != liver) continue;
                            const Vector3 p = Point3{static_cast<double>(i), static_cast<double>(j),
                                                     static_cast<double>(k)} -
                                              a;
                            const double t = std::clamp(dot(p, line) / length2, 0.0, 1.0);
                            const double d = norm(p - t * line) - (ra + t * (rb - ra));
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
                        }
                    }
                }
            }
        }
    }
}

}  // namespace sonocase::pipeline
