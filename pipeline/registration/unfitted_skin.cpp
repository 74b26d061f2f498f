// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/unfitted_skin.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/matching/target_surface.h"

namespace sonocase::pipeline {
namespace {

constexpr double kStep_mm = 8;  // between the points that stand for a large triangle

// The points of the target, and more on triangles larger than a step.
std::vector<Point3> places_on(const TargetSurface& target) {
    std::vector<Point3> places = target.points;
    for (const auto& t : target.triangles) {
        const Point3 a = target.points[t[0]];
        const Vector3 ab = target.points[t[1]] - a, ac = target.points[t[2]] - a;
        const double longest = std::max({norm(ab), norm(ac), norm(ab - ac)});
        const int steps = static_cast<int>(std::ceil(std::min(longest / kStep_mm, 200.0)));
        for (int i = 0; i <= steps && steps > 1; ++i) {
            for (int j = 0; i + j <= steps; ++j) {
                const double u = static_cast<double>(i) / steps, v = static_cast<double>(j) / steps;
                places.push_back(a + (u * ab + v * ac));
            }
        }
    }
    return places;
}

}  // namespace

Result<std::vector<std::uint8_t>> unfitted_skin(const Surface& skin,
                                                const Surface& mannequin,
                                                const Registration& registration) {
    const Result<TargetSurface> target = prepare_target(mannequin);
    if (!target) return target.error();
    const std::vector<Point3> places = places_on(*target);
    const PointIndex index(places);
    std::vector<std::uint8_t> unfitted(skin.points.size(), 0);
    parallel_for(skin.points.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Vector3 mapped = mannequin_from_ct(registration, skin.points[i]) - target->origin;
            double d2 = 0;
            index.nearest(Point3{} + mapped, &d2);
            unfitted[i] = d2 > kNotFitted_mm * kNotFitted_mm;
        }
    });
    if (std::none_of(unfitted.begin(), unfitted.end(), [](std::uint8_t u) { return u != 0; }))
        unfitted.clear();
    return unfitted;
}

}  // namespace sonocase::pipeline
