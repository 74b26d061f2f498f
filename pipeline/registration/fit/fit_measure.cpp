// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/fit_measure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/fit/matching.h"
#include "pipeline/registration/fit/target_surface.h"

namespace sonocase::pipeline::inline registration_fit {

namespace {

constexpr double kFarthestMm = 40;
constexpr double kMinCosine = 0.3;

// Triangles around each point.
struct Fans {
    std::vector<std::uint32_t> start, triangle;
    explicit Fans(const Surface& s) : start(s.points.size() + 1, 0) {
        for (const auto& t : s.triangles) {
            for (std::uint32_t v : t) ++start[v + 1];
        }
        for (std::size_t i = 1; i < start.size(); ++i) start[i] += start[i - 1];
        triangle.resize(start.back());
        std::vector<std::uint32_t> at(start.begin(), start.end() - 1);
        for (std::size_t f = 0; f < s.triangles.size(); ++f) {
            for (std::uint32_t v : s.triangles[f])
                triangle[at[v]++] = static_cast<std::uint32_t>(f);
        }
    }
};

struct Closest {
    double distance = std::numeric_limits<double>::infinity();
    double weight[3] = {0, 0, 0};  // barycentric
    std::uint32_t triangle = 0;
};

// Closest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
void closest_on_triangle(Point3 p, Point3 a, Point3 b, Point3 c, double* wb, double* wc) {
    const Vector3 ab = b - a, ac = c - a, ap = p - a;
    const double d1 = dot(ab, ap), d2 = dot(ac, ap);
    *wb = *wc = 0;
    if (d1 <= 0 && d2 <= 0) return;
    const Vector3 bp = p - b;
    const double d3 = dot(ab, bp), d4 = dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) {
        *wb = 1;
        return;
    }
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        *wb = d1 / (d1 - d3);
        return;
    }
    const Vector3 cp = p - c;
    const double d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) {
        *wc = 1;
        return;
    }
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        *wc = d2 / (d2 - d6);
        return;
    }
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        *wc = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        *wb = 1 - *wc;
        return;
    }
    const double sum = va + vb + vc;
    if (!(sum > 0)) return;
    *wb = vb / sum;
    *wc = vc / sum;
}

double depth_behind_table_mm(const Surface& mapped, const Table& table) {
    if (!table.found) return 0;
    std::vector<double> depth;
    for (std::size_t i = 0; i < mapped.points.size(); ++i) {
        if (dot(mapped.normals[i], table.normal) > -kMinCosine) continue;
        depth.push_back(std::max(0.0, dot(table.normal, table.place - mapped.points[i])));
    }
    if (depth.empty()) return 0;
    std::sort(depth.begin(), depth.end());
    return depth[std::min(depth.size() - 1, depth.size() * 95 / 100)];
}

}  // namespace

Surface mapped_skin(const Surface& skin, const Registration& registration, Point3 target_origin) {
    Surface mapped;
    mapped.points.resize(skin.points.size());
    mapped.normals.resize(skin.points.size());
    mapped.triangles = skin.triangles;
    parallel_for(skin.points.size(), 1024, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            mapped.points[i] =
                Point3{} + (mannequin_from_ct(registration, skin.points[i]) - target_origin);
            const Matrix3 j = jacobian(registration, skin.points[i]);
            mapped.normals[i] = normalized(transpose(inverse(j)) * skin.normals[i]);
        }
    });
    return mapped;
}

FitMeasure measure_fit(const SkinSurfaceResult& skin,
                       const TargetSurface& target,
                       const Registration& registration) {
    const Surface mapped = mapped_skin(skin.skin, registration, target.origin);
    const PointIndex index(mapped.points);
    const Fans fans(mapped);
    const std::vector<std::uint32_t> readings = thin_target(target, 0);
    std::vector<double> gap(readings.size(), std::numeric_limits<double>::quiet_NaN());
    std::vector<std::uint8_t> off_skin(readings.size(), 0);
    parallel_for(readings.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const Point3 p = target.points[readings[n]];
            Closest best;
            for (std::uint32_t v : index.nearest(p, 3)) {
                for (std::uint32_t f = fans.start[v]; f < fans.start[v + 1]; ++f) {
                    const auto& t = mapped.triangles[fans.triangle[f]];
                    const Point3 a = mapped.points[t[0]], b = mapped.points[t[1]],
                                 c = mapped.points[t[2]];
                    double wb, wc;
                    closest_on_triangle(p, a, b, c, &wb, &wc);
                    const double d = distance(p, a + (wb * (b - a) + wc * (c - a)));
                    if (d < best.distance) best = {d, {1 - wb - wc, wb, wc}, fans.triangle[f]};
                }
            }
            if (!std::isfinite(best.distance)) continue;
            const auto& t = mapped.triangles[best.triangle];
            // At an open edge the skin ends: the reading belongs to what lies beyond.
            bool beyond = true;
            Vector3 normal;
            for (std::size_t v = 0; v < 3; ++v) {
                if (best.weight[v] > 1e-9 && !skin.on_rim[t[v]]) beyond = false;
                normal = normal + best.weight[v] * mapped.normals[t[v]];
            }
            const bool on_edge =
                best.weight[0] < 1e-9 || best.weight[1] < 1e-9 || best.weight[2] < 1e-9;
            if (beyond && on_edge) continue;
            off_skin[n] = best.distance > kOffSkinMm;
            if (best.distance > kFarthestMm) continue;
            const double cosine = dot(normalized(normal), target.normals[readings[n]]);
            if (cosine < kMinCosine) continue;
            const Point3 nearest = mapped.points[t[0]] +
                                   (best.weight[1] * (mapped.points[t[1]] - mapped.points[t[0]]) +
                                    best.weight[2] * (mapped.points[t[2]] - mapped.points[t[0]]));
            gap[n] = std::copysign(best.distance, dot(normal, p - nearest));
        }
    });
    FitMeasure m;
    m.readings = static_cast<long>(readings.size());
    m.off_skin = std::count(off_skin.begin(), off_skin.end(), 1);
    std::vector<double> size;
    for (double g : gap) {
        if (std::isfinite(g)) size.push_back(std::abs(g));
    }
    if (!size.empty()) {
        std::sort(size.begin(), size.end());
        const double sigma = 1.4826 * size[size.size() / 2];
        const double limit = std::max(8.0, 5 * sigma);
        const auto kept = static_cast<std::size_t>(
            std::upper_bound(size.begin(), size.end(), limit) - size.begin());
        m.unexplained = static_cast<long>(size.size() - kept);
        m.counterparts = static_cast<long>(kept);
        size.resize(kept);
        double square = 0;
        for (double s : size) square += s * s;
        m.rms_mm = std::sqrt(square / static_cast<double>(kept));
        m.median_mm = size[kept / 2];
        m.p95_mm = size[std::min(kept - 1, kept * 95 / 100)];
        m.max_mm = size.back();
        for (double g : gap) {
            if (std::isfinite(g) && std::abs(g) <= limit)
                m.mean_signed_mm += g / static_cast<double>(kept);
        }
        m.coverage = static_cast<double>(kept) / static_cast<double>(std::max(1L, m.readings));
    }
    m.behind_table_mm = depth_behind_table_mm(mapped, target.table);
    long covered = 0;
    for (double g : signed_gaps(mapped, target)) covered += std::isfinite(g);
    m.skin_coverage = static_cast<double>(covered) / static_cast<double>(mapped.points.size());
    return m;
}

std::vector<double> signed_gaps(const Surface& mapped, const TargetSurface& target) {
    std::vector<double> gaps(mapped.points.size(), std::numeric_limits<double>::quiet_NaN());
    const double side = 1.2 * target.spacing_mm;
    parallel_for(mapped.points.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            double d2 = 0;
            const std::uint32_t j = target.index.nearest(mapped.points[i], &d2);
            if (d2 > kFarthestMm * kFarthestMm || target.lifted[j]) continue;
            if (dot(mapped.normals[i], target.normals[j]) < kMinCosine) continue;
            const double gap = dot(target.normals[j], mapped.points[i] - target.points[j]);
            const double aside2 = d2 - gap * gap;
            if (aside2 > (target.on_rim[j] ? 0.15 : 1.0) * side * side) continue;
            gaps[i] = gap;
        }
    });
    return gaps;
}

namespace {

constexpr double kStepMm = 8;  // between the points that stand for a large triangle

// The points of the target, and more on triangles larger than a step.
std::vector<Point3> places_on(const TargetSurface& target) {
    std::vector<Point3> places = target.points;
    for (const auto& t : target.triangles) {
        const Point3 a = target.points[t[0]];
        const Vector3 ab = target.points[t[1]] - a, ac = target.points[t[2]] - a;
        const double longest = std::max({norm(ab), norm(ac), norm(ab - ac)});
        const int steps = static_cast<int>(std::ceil(std::min(longest / kStepMm, 200.0)));
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
    SONOCASE_TRY(const TargetSurface target, prepare_target(mannequin));
    const std::vector<Point3> places = places_on(target);
    const PointIndex index(places);
    std::vector<std::uint8_t> unfitted(skin.points.size(), 0);
    parallel_for(skin.points.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Vector3 mapped = mannequin_from_ct(registration, skin.points[i]) - target.origin;
            double d2 = 0;
            index.nearest(Point3{} + mapped, &d2);
            unfitted[i] = d2 > kNotFittedMm * kNotFittedMm;
        }
    });
    if (std::none_of(unfitted.begin(), unfitted.end(), [](std::uint8_t u) { return u != 0; }))
        unfitted.clear();
    return unfitted;
}

}  // namespace sonocase::pipeline::inline registration_fit
