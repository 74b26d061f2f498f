// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/matching.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/map_evaluator.h"

namespace sonocase::pipeline::inline registration_fit {

namespace {

// The first point in each cube of a regular lattice, in the order of the points.
std::vector<std::uint32_t> one_per_cube(std::span<const Point3> points, double spacing_mm) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed;
    keyed.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        std::uint64_t key = 0;
        for (int a = 0; a < 3; ++a) {
            const auto cell =
                static_cast<std::int64_t>(std::floor(points[i][a] / spacing_mm)) + (1 << 20);
            key = key << 21 | (static_cast<std::uint64_t>(cell) & 0x1FFFFF);
        }
        keyed.push_back({key, static_cast<std::uint32_t>(i)});
    }
    std::sort(keyed.begin(), keyed.end());
    std::vector<std::uint32_t> chosen;
    for (std::size_t n = 0; n < keyed.size(); ++n) {
        if (n == 0 || keyed[n].first != keyed[n - 1].first) chosen.push_back(keyed[n].second);
    }
    std::sort(chosen.begin(), chosen.end());
    return chosen;
}

// The gap along the mean of the two normals. Two points a step apart on one sphere then have gap 0,
// while along either normal alone it is step^2 / (2 radius).
Match match_of(std::uint32_t skin,
               Point3 mapped,
               Vector3 mapped_normal,
               const TargetSurface& target,
               std::uint32_t j) {
    const Vector3 n = normalized(mapped_normal + target.normals[j]);
    return {skin, target.points[j], n, dot(n, mapped - target.points[j])};
}

}  // namespace

SkinModel thin_skin(const Surface& skin,
                    std::span<const std::uint8_t> on_rim,
                    Point3 origin,
                    double spacing_mm) {
    std::vector<Point3> points;
    points.reserve(skin.points.size());
    for (Point3 p : skin.points) points.push_back(Point3{} + (p - origin));
    SkinModel model;
    model.origin = origin;
    const auto take = [&](std::size_t i) {
        model.points.push_back(points[i]);
        model.normals.push_back(skin.normals[i]);
        model.on_rim.push_back(on_rim[i]);
    };
    if (spacing_mm <= 0) {
        for (std::size_t i = 0; i < points.size(); ++i) take(i);
        return model;
    }
    std::vector<std::uint8_t> chosen(points.size(), 0);
    for (std::uint32_t i : one_per_cube(points, spacing_mm)) chosen[i] = 1;
    // The whole rim is kept: a gap in it would match readings beyond it.
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (chosen[i] || on_rim[i]) take(i);
    }
    return model;
}

std::vector<std::uint32_t> thin_target(const TargetSurface& target, double spacing_mm) {
    std::vector<std::uint32_t> chosen;
    if (spacing_mm > 0) {
        chosen = one_per_cube(target.points, spacing_mm);
    } else {
        for (std::size_t i = 0; i < target.points.size(); ++i)
            chosen.push_back(static_cast<std::uint32_t>(i));
    }
    std::erase_if(chosen, [&](std::uint32_t i) { return target.lifted[i] != 0; });
    return chosen;
}

Matches find_matches(const SkinModel& skin,
                     std::span<const Point3> mapped,
                     std::span<const Vector3> mapped_normals,
                     const PointIndex& mapped_index,
                     const TargetSurface& target,
                     std::span<const std::uint32_t> readings,
                     std::size_t skin_stride,
                     const MatchOptions& options) {
    struct Found {
        Match match;
        bool ok = false;
    };
    const double farthest2 = options.farthest_mm * options.farthest_mm;
    // Farther points are not searched for; on the bound the exact distance decides.
    const double within2 = farthest2 * (1 + 1e-9);
    Matches matches;
    matches.target_queries = readings.size();
    std::vector<Found> found(readings.size());
    parallel_for(readings.size(), 128, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const std::uint32_t j = readings[n];
            double d2 = 0;
            const std::uint32_t i =
                mapped_index.nearest_within(target.points[j], within2, PointIndex::kNone, &d2);
            if (i == PointIndex::kNone) continue;
            if (d2 > farthest2 || skin.on_rim[i]) continue;
            if (dot(mapped_normals[i], target.normals[j]) < options.min_cosine) continue;
            found[n] = {match_of(i, mapped[i], mapped_normals[i], target, j), true};
        }
    });
    matches.from_target.reserve(found.size());
    for (const Found& f : found) {
        if (f.ok) matches.from_target.push_back(f.match);
    }

    const std::size_t queries =
        skin_stride > 0 ? (skin.points.size() + skin_stride - 1) / skin_stride : 0;
    found.assign(queries, {});
    parallel_for(queries, 128, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const std::size_t i = n * skin_stride;
            if (skin.on_rim[i]) continue;
            double d2 = 0;
            const std::uint32_t j =
                target.index.nearest_within(mapped[i], within2, PointIndex::kNone, &d2);
            if (j == PointIndex::kNone) continue;
            if (d2 > farthest2 || target.lifted[j]) continue;
            if (dot(mapped_normals[i], target.normals[j]) < options.min_cosine) continue;
            const double gap = dot(target.normals[j], mapped[i] - target.points[j]);
            const double aside = std::sqrt(std::max(0.0, d2 - gap * gap));
            // Beside a rim reading the mannequin may end.
            if (aside > (target.on_rim[j] ? 0.35 : 1.0) * options.side_step_mm) continue;
            found[n] = {
                match_of(static_cast<std::uint32_t>(i), mapped[i], mapped_normals[i], target, j),
                true};
        }
    });
    for (std::size_t n = 0; n < queries; ++n) {
        matches.skin_queries += !skin.on_rim[n * skin_stride];
        if (found[n].ok) matches.from_skin.push_back(found[n].match);
    }
    return matches;
}

MappedSkin map_skin(const SkinModel& skin, Point3 target_origin, const Registration& registration) {
    const MapEvaluator evaluate(registration);
    const Vector3 shift_in = skin.origin - evaluate.ct_centre();
    const Vector3 shift_out = evaluate.mannequin_centre() - target_origin;
    MappedSkin mapped;
    mapped.points.resize(skin.points.size());
    mapped.normals.resize(skin.points.size());
    parallel_for(skin.points.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const MapSample s = evaluate((skin.points[i] - Point3{}) + shift_in);
            mapped.points[i] = Point3{} + (s.value + shift_out);
            mapped.normals[i] = normalized(transpose(inverse(s.jacobian)) * skin.normals[i]);
        }
    });
    mapped.index = PointIndex(mapped.points);
    return mapped;
}

}  // namespace sonocase::pipeline::inline registration_fit
