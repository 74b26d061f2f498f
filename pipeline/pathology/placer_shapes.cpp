// SPDX-License-Identifier: Apache-2.0

// Shapes that follow the anatomy: widened vessels, pools, swellings, tubes.
#include <algorithm>
#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/pathology/placer.h"
#include "pipeline/pathology/region_shapes.h"

namespace sonocase::pipeline {

// A vessel that widens: along its axis, through its wall into whatever yields.
Result<Lesion> Placer::bulge(const Context& c, const RoughEllipsoid& given, double radius_mm) {
    const PathologyRequest& r = c.request;
    const VoxelRange range = range_of(canvas_.volume(), c.host, 2);
    const VoxelField depth = distance_to_labels(canvas_.volume(), c.host, range, kSwellReachMm);
    std::optional<Vector3> wanted;
    if (r.centre) wanted = voxel_of(*r.centre, r.in_mannequin);
    if (r.near && !wanted) wanted = voxel_of(*r.near, r.in_mannequin);
    Vector3 centre;
    double best = 1e18;
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) {
                if (!c.host[canvas_.label({i, j, k})]) continue;
                const Vector3 v{static_cast<double>(i), static_cast<double>(j),
                                static_cast<double>(k)};
                const double away = wanted ? 0.3 * norm(v - *wanted) : 0;
                const double score = depth(v) + away;
                if (score >= best) continue;
                best = score;
                centre = v;
            }
    RoughEllipsoid shape = given;
    shape.align(long_axis(canvas_, c.host, centre, 25 / c.voxel_mm));
    Lesion lesion;
    lesion.centre_vx = centre;
    lesion.radius_vx = radius_mm / c.voxel_mm;
    lesion.down = c.down;
    lesion.into = ~fixed_;
    lesion.range = canvas_.around(centre, 1.2 * shape.greatest_radius() * lesion.radius_vx + 2);
    const VoxelField rank = untied(shape.rank_about(centre));
    std::size_t found = 0;
    const double threshold = canvas_.threshold(lesion.range, rank, lesion.into, c.voxels, &found);
    lesion.distance = distance_to_level(rank, threshold, 1);
    return lesion;
}

Result<Lesion> Placer::filled(const Context& c,
                              const VoxelRange& range,
                              const VoxelField& tied,
                              const VoxelField& limit,
                              const Labels& into,
                              std::size_t voxels) {
    const VoxelField rank = untied(tied);
    const VoxelField limited = [&](Vector3 at) {
        return limit && limit(at) > 0 ? static_cast<double>(INFINITY) : rank(at);
    };
    std::size_t found = 0;
    const double threshold = canvas_.threshold(range, limited, into, voxels, &found);
    const double ml = static_cast<double>(found) * canvas_.grid().voxel_volume_mm3() / 1000;
    if (found < voxels)
        return Error{"there is room for " + ml_text(ml) + " ml and not for " + ml_text(c.volume_ml),
                     c.where, found == 0 ? "no voxel of its host lies there" : "make it smaller"};
    Lesion lesion;
    lesion.range = range;
    lesion.distance = distance_to_level(rank, threshold, 1);
    if (limit) lesion.distance = intersection(lesion.distance, limit);
    lesion.radius_vx = ball_radius_mm(c.volume_ml) / c.voxel_mm;
    lesion.down = c.down;
    lesion.into = into;
    return lesion;
}

Result<Lesion> Placer::pool(const Context& c) {
    const PathologyRequest& r = c.request;
    const int reach = r.beside.empty() ? 1 : static_cast<int>((r.reach_mm + 6) / c.voxel_mm);
    const VoxelRange range = range_of(canvas_.volume(), c.host, reach);
    VoxelField limit;
    const auto also = [&](VoxelField field) {
        limit = limit ? intersection(limit, std::move(field)) : std::move(field);
    };
    if (!r.beside.empty()) {
        const double reach_vx = r.reach_mm / c.voxel_mm;
        for (const std::string& name : r.beside) {
            const auto label = named({name}, c.where);
            if (!label) return label.error();
            const VoxelField near =
                distance_to_labels(canvas_.volume(), *label, range, r.reach_mm + 5);
            also([near, reach_vx](Vector3 at) { return near(at) - reach_vx; });
        }
    }
    if (r.near) also(ball(voxel_of(*r.near, r.in_mannequin), r.near_mm / c.voxel_mm));
    return filled(c, range, height_rank(c.down), limit, c.host, c.voxels);
}

Result<Lesion> Placer::swelling(const Context& c) {
    const auto into = named(c.request.into, c.where);
    if (!into) return into.error();
    const int grown = into->none() ? 1 : static_cast<int>(40 / c.voxel_mm);
    const VoxelRange range = range_of(canvas_.volume(), c.host, grown);
    return filled(c, range, distance_to_labels(canvas_.volume(), c.host, range, kSwellReachMm), {},
                  c.host | *into, c.voxels);
}

Result<Lesion> Placer::tube(const Context& c) {
    const PathologyRequest& r = c.request;
    if (!r.path.empty()) {
        std::vector<Vector3> path;
        VoxelRange range{{1 << 29, 1 << 29, 1 << 29}, {-(1 << 29), -(1 << 29), -(1 << 29)}};
        const double radius_vx = 0.5 * r.diameter_mm / c.voxel_mm;
        for (const Point3 p : r.path) {
            path.push_back(voxel_of(p, r.in_mannequin));
            const VoxelRange one = canvas_.around(path.back(), radius_vx + 3);
            for (int axis = 0; axis < 3; ++axis) {
                range.low[axis] = std::min(range.low[axis], one.low[axis]);
                range.high[axis] = std::max(range.high[axis], one.high[axis]);
            }
        }
        Lesion lesion;
        lesion.range = range;
        const VoxelField rank = path_rank(path);
        lesion.distance = [rank, radius_vx](Vector3 at) { return rank(at) - radius_vx; };
        lesion.centre_vx = path[path.size() / 2];
        lesion.radius_vx = radius_vx;
        lesion.down = c.down;
        lesion.into = c.host;
        return lesion;
    }
    // In a vessel: a stretch of it, filled from below.
    const VoxelRange range = range_of(canvas_.volume(), c.host, 1);
    if (range.empty()) return Error{"its host has no voxel", c.where, "name another"};
    Vector3 middle;
    if (r.centre || r.near) {
        middle = voxel_of(r.centre ? *r.centre : *r.near, r.in_mannequin);
    } else {
        const Clearances& clear = clearances(c.host, false);
        const auto inside = clear.deeper_than(c.voxel_mm);
        if (inside.empty())
            return Error{"its host is thinner than a voxel", c.where, "name another"};
        const auto n = static_cast<std::size_t>(
            uniform_at(derive_seed(static_cast<std::uint64_t>(r.seed), 11), 0) *
            static_cast<double>(inside.size()));
        const VoxelBox& box = clear.box();
        const std::uint32_t at = inside[n], x = static_cast<std::uint32_t>(box.size.x),
                            y = static_cast<std::uint32_t>(box.size.y);
        middle = {static_cast<double>(box.first.x) + at % x,
                  static_cast<double>(box.first.y) + at / x % y,
                  static_cast<double>(box.first.z) + at / x / y};
    }
    const VoxelField limit = ball(middle, 0.5 * r.length_mm / c.voxel_mm);
    std::size_t lumen = 0;
    const VoxelField rank = height_rank(c.down);
    canvas_.threshold(
        range, [&](Vector3 at) { return limit(at) > 0 ? INFINITY : 0.0; }, c.host, 1, &lumen);
    const auto voxels =
        static_cast<std::size_t>(std::max(1.0, std::round(r.share * static_cast<double>(lumen))));
    if (lumen == 0)
        return Error{"no voxel of its host lies within " + ml_text(0.5 * r.length_mm) + " mm",
                     c.where, "move its centre"};
    auto lesion = filled(c, range, rank, limit, c.host, voxels);
    if (lesion) lesion->centre_vx = middle;
    return lesion;
}

}  // namespace sonocase::pipeline
