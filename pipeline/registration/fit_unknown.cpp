// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit_unknown.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "formats/base/random.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration {
namespace {

constexpr std::size_t kPointsOfAnOrgan = 25;
constexpr double kBlockMm = 60;
// The head's direction is pointed at by hand, to some 8 degrees (root mean square, both axes).
constexpr double kUpError = 0.1;
// Slopes that differ from the quadratic's are about three times as steep as those expected of it.
constexpr double kFarther = 3;
// Share of the readings, and of the skin, of which a fit that has not slid reaches more.
constexpr double kReached = 0.5;
// The excess of the design effect at which a quadratic and another body are as likely.
constexpr double kHalfSure = 1;

// Where structures lie: ct, relative to the skin's origin.
struct Places {
    std::string label;
    std::vector<Point3> points;
};

std::vector<Places> places_of(const FitContext& s) {
    std::vector<Places> all;
    if (!s.labels) return all;
    const Grid& grid = s.labels->grid;
    std::vector<std::size_t> voxels(256, 0), seen(256, 0);
    for (const std::uint8_t v : s.labels->voxels) ++voxels[v];
    std::vector<Places> places(s.labels->labels.size());
    std::size_t n = 0;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i, ++n) {
                const std::uint8_t v = s.labels->voxels[n];
                if (v == 0 || v >= places.size()) continue;
                const std::size_t at = seen[v]++, stride = 1 + voxels[v] / kPointsOfAnOrgan;
                if (at % stride != stride / 2) continue;
                places[v].points.push_back(
                    Point3{} +
                    (grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}) - s.fine.origin));
            }
        }
    }
    for (std::size_t v = 1; v < places.size(); ++v) {
        if (places[v].points.empty()) continue;
        places[v].label = s.labels->labels[v].name;
        all.push_back(std::move(places[v]));
    }
    return all;
}

// Sum of twelve uniform numbers: logarithms and cosines differ between machines.
double normal_deviate(RandomStream& random) {
    double sum = -6;
    for (int n = 0; n < 12; ++n) sum += random.unit();
    return sum;
}

Vector3 deviate(RandomStream& random, double size) {
    const double x = normal_deviate(random), y = normal_deviate(random), z = normal_deviate(random);
    return {size * x, size * y, size * z};
}

// The block of each target point, numbered in sorted order.
std::vector<std::size_t> blocks_of(const TargetSurface& target, std::size_t* count) {
    std::vector<std::array<int, 3>> cube;
    for (Point3 p : target.points) {
        std::array<int, 3> c{};
        for (int a = 0; a < 3; ++a)
            c[static_cast<std::size_t>(a)] = static_cast<int>(std::floor(p[a] / kBlockMm));
        cube.push_back(c);
    }
    std::vector<std::array<int, 3>> distinct = cube;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    *count = distinct.size();
    std::vector<std::size_t> block;
    for (const auto& c : cube) {
        block.push_back(static_cast<std::size_t>(
            std::lower_bound(distinct.begin(), distinct.end(), c) - distinct.begin()));
    }
    return block;
}

// The fit of one half of the blocks.
Registration refit(const FitContext& s,
                   const Rigid& rigid,
                   const RegisterOptions& options,
                   const WarpFit& w,
                   std::span<const std::size_t> block,
                   std::size_t blocks,
                   const std::optional<SplinePenalty>& penalty,
                   std::uint64_t n) {
    RandomStream random(kGoldenGamma * (n + 1));
    std::vector<std::size_t> order(blocks);
    for (std::size_t b = 0; b < blocks; ++b) order[b] = b;
    for (std::size_t b = 0; b + 1 < blocks; ++b)
        std::swap(order[b], order[b + random.below(blocks - b)]);
    std::vector<std::uint8_t> left_out(blocks, 0);
    for (std::size_t b = 0; b < blocks / 2; ++b) left_out[order[b]] = 1;

    TargetSurface half;
    half.origin = s.target.origin;
    half.points = s.target.points;
    half.normals = s.target.normals;
    half.on_rim = s.target.on_rim;
    half.lifted = s.target.lifted;
    half.spacing_mm = s.target.spacing_mm;
    half.thickness_mm = s.target.thickness_mm;
    half.table = s.target.table;
    half.index = PointIndex(half.points);
    for (std::size_t i = 0; i < block.size(); ++i)
        if (left_out[block[i]]) half.lifted[i] = 1;
    std::vector<std::uint32_t> readings;
    for (const std::uint32_t i : s.readings)
        if (!half.lifted[i]) readings.push_back(i);

    PoseHints hints = s.hints;
    std::vector<Correspondence> landmarks = s.landmarks;
    if (hints.up) hints.up = normalized(*hints.up + deviate(random, kUpError));
    for (std::size_t m = 0; m < landmarks.size(); ++m) {
        landmarks[m].place = landmarks[m].place + deviate(random, options.landmark_mm);
        hints.landmarks[m].target = landmarks[m].place;
    }
    const Rigid pose = refine_rigid_robust(s.fine, half, rigid, hints, 6, 15);
    RigidQuadratic q = RigidQuadratic::from_rigid(pose);
    if (!w.kept_rigid) {
        for (RefineOptions step : w.steps) {
            step.landmarks = landmarks;
            q = refine_quadratic(s.fine, half, readings, q, step).map;
        }
    }
    Registration map = in_frames(s, q);
    if (w.path == "residual") {
        fit_field(s.fine, half, readings, options.residual, *penalty, &map);
    } else if (w.path == "elastic") {
        map.residual = w.registration.residual;
        ElasticOptions elastic = options.elastic;
        elastic.spacing_mm = options.residual.spacing_mm;
        elastic.stiffness = w.stiffness;
        const ElasticInput input{.skin = s.fine,
                                 .target = half,
                                 .readings = readings,
                                 .landmarks = landmarks,
                                 .landmark_weight = s.hints.landmark_weight,
                                 .labels = s.labels};
        fit_elastic(input, elastic, &map);
    }
    return map;
}

std::vector<Registration> refits(const FitContext& s,
                                 const Rigid& rigid,
                                 const RegisterOptions& options,
                                 const WarpFit& w) {
    std::size_t blocks = 0;
    const std::vector<std::size_t> block = blocks_of(s.target, &blocks);
    std::optional<SplinePenalty> penalty;
    if (w.path == "residual") {
        ResidualOptions residual = options.residual;
        residual.bending = w.residual.bending;
        residual.depth_penalty = w.residual.depth_penalty;
        penalty = field_penalty(s.fine, w.registration.ct_box, residual);
    }
    std::vector<Registration> maps(static_cast<std::size_t>(std::max(0, options.refits)));
    parallel_for(maps.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
            maps[n] = refit(s, rigid, options, w, block, blocks, penalty, n);
    });
    return maps;
}

// Of a displacement with three independent components of one size, over its root mean square:
// roots of the quantiles of chi-squared with three degrees of freedom over three.
constexpr double kMedianOfRms = 0.888, kP90OfRms = 1.443, kP95OfRms = 1.614;

// How far apart two maps carry a place, root mean square over its points.
template <class MapA, class MapB>
double apart(const Places& place, const MapA& a, const MapB& b) {
    double sum = 0;
    for (Point3 p : place.points) {
        const Vector3 d = a(p) - b(p);
        sum += dot(d, d);
    }
    return std::sqrt(sum / static_cast<double>(place.points.size()));
}

// Root mean square of the displacement beyond the quadratic. A body can be read either way, as a
// quadratic or with the displacement, so that this is left open as well.
double displaced_mm(const FitContext& s,
                    const Registration& map,
                    const std::vector<Point3>& points) {
    if (map.residual.control_mm.empty() || points.empty()) return 0;
    double sum = 0;
    for (Point3 p : points) {
        const Vector3 d = displacement(map.residual, s.fine.origin + (p - Point3{}));
        sum += dot(d, d);
    }
    return std::sqrt(sum / static_cast<double>(points.size()));
}

// Where neither half of the readings has its skin nor half of the skin its readings, the body has
// slid off them: it must lie as far from here as they lie from it (95th percentile).
double slid_mm(const FitContext& s, const WarpFit& w) {
    if (w.fit.coverage >= kReached || w.fit.skin_coverage >= kReached) return 0;
    std::vector<Point3> skin;
    for (Point3 p : s.fine.points)
        skin.push_back(
            Point3{} +
            (mannequin_from_ct(w.registration, s.fine.origin + (p - Point3{})) - s.target.origin));
    const PointIndex index(skin);
    std::vector<double> away;
    for (Point3 p : s.target.points) away.push_back(distance(p, skin[index.nearest(p)]));
    if (away.empty()) return 0;
    std::sort(away.begin(), away.end());
    return away[away.size() * 95 / 100];
}

// Of maps drawn from the posterior, root mean square over draws and points.
double spread_of_draws(const Places& place, const RigidQuadratic& q, const QuadraticTrust& trust) {
    double sum = 0;
    for (RigidQuadratic draw : trust.draws) {
        for (int d = 0; d < 3; ++d) {
            for (int c = 0; c < 10; ++c) draw.k[d][c] -= q.k[d][c];
        }
        const double moved = apart(
            place, [&](Point3 p) { return map_point(draw, p); }, [](Point3) { return Point3{}; });
        sum += moved * moved;
    }
    return trust.draws.empty() ? 0 : std::sqrt(sum / static_cast<double>(trust.draws.size()));
}

double spread_of_refits(const FitContext& s,
                        const Places& place,
                        const Registration& map,
                        const std::vector<Registration>& others) {
    const auto through = [&](const Registration& r) {
        return [&](Point3 p) { return mannequin_from_ct(r, s.fine.origin + (p - Point3{})); };
    };
    double sum = 0;
    for (const Registration& other : others) {
        const double off = apart(place, through(other), through(map));
        sum += off * off;
    }
    return others.empty() ? 0 : std::sqrt(sum / static_cast<double>(others.size()));
}

Spread quantiles(double rms) {
    return {kMedianOfRms * rms, kP90OfRms * rms, kP95OfRms * rms};
}

// The posterior with two landmarks more, one near either end of the skin.
QuadraticTrust trust_with_landmarks(const FitContext& s,
                                    const RigidQuadratic& q,
                                    const RegisterOptions& options,
                                    const WarpFit& w) {
    std::vector<Point3> inner;
    for (std::size_t i = 0; i < s.fine.points.size(); ++i) {
        if (!s.fine.on_rim[i]) inner.push_back(s.fine.points[i]);
    }
    if (inner.empty() || w.steps.empty()) return {};
    const auto [low, high] = std::minmax_element(inner.begin(), inner.end(),
                                                 [](Point3 a, Point3 b) { return a.z < b.z; });
    RefineOptions refine;
    refine.constraint_mm = w.steps.back().constraint_mm;
    refine.landmarks = s.landmarks;
    refine.landmark_weight = landmark_weight(w.trust, options.landmark_mm);
    for (Point3 p : {*low, *high}) refine.landmarks.push_back({p, map_point(q, p)});
    return trust_quadratic(s.fine, s.target, s.readings, q, refine, options.strain, s.inside);
}

}  // namespace

double landmark_weight(const QuadraticTrust& trust, double landmark_mm) {
    const double ratio = trust.standard_error_mm / std::max(landmark_mm, 0.1);
    return std::clamp(ratio * ratio, 1e-5, 0.02);
}

double beyond_quadratic(const QuadraticTrust& trust) {
    const double excess = std::max(0.0, trust.design_effect - 1);
    return std::sqrt(1 + kFarther * kFarther * excess / (excess + kHalfSure));
}

void find_unknown(const FitContext& s,
                  const Rigid& rigid,
                  const RigidQuadratic& judged,
                  const RegisterOptions& options,
                  const Progress& progress,
                  WarpFit* w) {
    report_progress(progress, 0.9, "what the readings leave open");
    const double displaced_inside = displaced_mm(s, w->registration, s.inside),
                 slid = slid_mm(s, *w);
    const auto inside = [&](const QuadraticTrust& trust) {
        return std::hypot(std::hypot(beyond_quadratic(trust) * trust.inside_mm, displaced_inside),
                          slid);
    };
    w->inside_mm = inside(w->trust);
    QuadraticTrust held;
    if (s.landmarks.empty() && !options.paper_warp) {
        held = trust_with_landmarks(s, judged, options, *w);
        if (held.inside_mm > 0) w->with_landmarks_mm = inside(held);
    }
    if (!s.labels || w->trust.draws.empty() || s.inside.empty()) return;
    std::vector<Registration> others;
    if (options.uncertainty == "on") others = refits(s, rigid, options, *w);
    for (const Places& place : places_of(s)) {
        const double displaced = displaced_mm(s, w->registration, place.points);
        const auto said = [&](const QuadraticTrust& trust) {
            const double spread = beyond_quadratic(trust) * spread_of_draws(place, judged, trust);
            return quantiles(std::hypot(std::hypot(spread, displaced), slid));
        };
        OrganUnknown unknown;
        unknown.label = place.label;
        unknown.covariance = said(w->trust);
        if (!others.empty()) {
            const double halves = spread_of_refits(s, place, w->registration, others);
            unknown.halves_p90_mm = kP90OfRms * halves;
            unknown.refits = quantiles(std::hypot(std::hypot(halves, displaced), slid));
        }
        const Spread &a = unknown.covariance, &b = unknown.refits;
        unknown.median_mm = std::max(a.median_mm, b.median_mm);
        unknown.p90_mm = std::max(a.p90_mm, b.p90_mm);
        unknown.p95_mm = std::max(a.p95_mm, b.p95_mm);
        if (!held.draws.empty()) unknown.p90_with_landmarks_mm = said(held).p90_mm;
        w->unknown.push_back(std::move(unknown));
    }
}

}  // namespace sonocase::pipeline::inline registration
