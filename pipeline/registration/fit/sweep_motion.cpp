// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/sweep_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration_fit {
namespace {

constexpr std::size_t kMaxPoints = 4000, kMinPart = 60, kMinPairs = 40;
constexpr int kPlaces = 7;       // in the order, at which a motion is looked for
constexpr int kNeighbours = 10;  // that define the plane through a reading
constexpr int kCompared = 6;     // neighbours that a reading is compared with to find the place
constexpr double kCubeMm = 60, kFarthestMm = 45;
constexpr double kFirstLossMm = 8, kLastLossMm = 3;  // Cauchy scale
constexpr int kRounds = 5;                           // of matching
// Expected beforehand, standard deviations; they keep at rest what a narrow border leaves open.
constexpr double kUsualShiftMm = 20, kUsualTurnRad = 0.1, kUsualGapMm = 2;
constexpr double kMinMotionMm = 2, kMinClosedMm = 0.6;
// Mean squared gap before over after: of readings all over a body at rest at most 1.11, and 1.8 of
// some 60 along a border. What no mannequin at rest reaches (43) is the logarithm times the pairs;
// motions of 5 mm or 2 degrees that were read all over have 170 and more.
constexpr double kMinGain = 1.15;
constexpr double kMinEvidence = 60;

// The readings of one part of the order, and the planes through their neighbours.
struct Part {
    std::vector<Point3> points;
    std::vector<Vector3> normals;  // of either sign
    PointIndex index;
    double spacing_mm = 0;
};

Part part_of(std::span<const Point3> points) {
    Part part;
    part.points.assign(points.begin(), points.end());
    part.index = PointIndex(part.points);
    std::vector<double> sixth;
    for (const Point3 p : points) {
        const std::vector<std::uint32_t> near = part.index.nearest(p, kNeighbours);
        Eigen::Vector3d mean = Eigen::Vector3d::Zero();
        const auto at = [&](std::uint32_t i) {
            return Eigen::Vector3d{part.points[i].x, part.points[i].y, part.points[i].z};
        };
        for (const std::uint32_t i : near) mean += at(i) / static_cast<double>(near.size());
        Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
        for (const std::uint32_t i : near) spread += (at(i) - mean) * (at(i) - mean).transpose();
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
        solver.computeDirect(spread);
        const Eigen::Vector3d n = solver.eigenvectors().col(0);
        part.normals.push_back({n[0], n[1], n[2]});
        sixth.push_back(distance(p, part.points[near[std::min<std::size_t>(6, near.size() - 1)]]));
    }
    const auto middle = sixth.begin() + static_cast<std::ptrdiff_t>(sixth.size() / 2);
    std::nth_element(sixth.begin(), middle, sixth.end());
    part.spacing_mm = *middle;
    return part;
}

// A point of the later readings, moved back, and the place of the earlier ones nearest to it.
struct Pair {
    Point3 p;
    Vector3 normal;  // the mean of both planes': two points of one sphere then have no gap
    double gap_mm;
    bool odd;  // the colour of its cube
};

bool odd_cube(Point3 p) {
    long sum = 0;
    for (int a = 0; a < 3; ++a) sum += std::lround(std::floor(p[a] / kCubeMm));
    return (sum & 1) != 0;
}

// Whether a step from a place to a point is farther along the surface than planes are flat.
bool is_beside(Vector3 step, double gap, double spacing_mm) {
    return dot(step, step) - gap * gap > 1.5 * 1.5 * spacing_mm * spacing_mm;
}

// Each point of the smaller part with the nearest of the larger one.
std::vector<Pair> pairs_of(const Part& earlier, const Part& later, const Rigid& back) {
    const bool from_later = later.points.size() < earlier.points.size();
    const Part &from = from_later ? later : earlier, &to = from_later ? earlier : later;
    const Rigid there = from_later ? back : inverse(back);
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < from.points.size(); ++i) {
        double d2 = 0;
        const Point3 p = there * from.points[i];
        const std::uint32_t j = to.index.nearest(p, &d2);
        if (d2 > kFarthestMm * kFarthestMm) continue;
        Vector3 n = there * from.normals[i];
        const Vector3 m = to.normals[j];
        if (dot(n, m) < 0) n = -n;
        if (dot(n, m) < 0.7) continue;
        const Vector3 normal = normalized(n + m);
        const double gap = dot(normal, p - to.points[j]);
        if (is_beside(p - to.points[j], gap, to.spacing_mm)) continue;
        const bool odd = odd_cube(from.points[i]);
        if (from_later) {
            pairs.push_back({p, normal, gap, odd});
        } else {
            const Vector3 out = back.rotation * normal;
            pairs.push_back({back * to.points[j], out, -gap, odd});
        }
    }
    return pairs;
}

double robust(double gap, double scale) {
    return scale * scale * std::log1p(gap * gap / (scale * scale));
}

enum class Cubes { all, even, odd };
bool counts(const Pair& pair, Cubes cubes) {
    return cubes == Cubes::all || pair.odd == (cubes == Cubes::odd);
}

// The motion that lays the later readings on the earlier ones.
Rigid motion_of(const Part& earlier, const Part& later, const Rigid& start, Cubes cubes) {
    Rigid back = start;
    Vector3 middle;
    for (const Point3 p : later.points)
        middle = middle + (p - Point3{}) / static_cast<double>(later.points.size());
    for (int round = 0; round < kRounds; ++round) {
        const double t = static_cast<double>(round) / (kRounds - 1);
        const double loss = kFirstLossMm * std::pow(kLastLossMm / kFirstLossMm, t);
        const Point3 centre = back * (Point3{} + middle);
        Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
        Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
        for (const Pair& pair : pairs_of(earlier, later, back)) {
            if (!counts(pair, cubes)) continue;
            const double g = pair.gap_mm, w = 1 / (1 + g * g / (loss * loss));
            const Vector3 m = cross(pair.p - centre, pair.normal), n = pair.normal;
            const Eigen::Matrix<double, 6, 1> row{m.x, m.y, m.z, n.x, n.y, n.z};
            a.noalias() += w * row * row.transpose();
            b -= w * g * row;
        }
        for (int axis = 0; axis < 3; ++axis) {
            a(axis, axis) += kUsualGapMm * kUsualGapMm / (kUsualTurnRad * kUsualTurnRad);
            a(axis + 3, axis + 3) += kUsualGapMm * kUsualGapMm / (kUsualShiftMm * kUsualShiftMm);
        }
        const Eigen::Matrix<double, 6, 1> x = a.ldlt().solve(b);
        const Vector3 turn{x[0], x[1], x[2]}, shift{x[3], x[4], x[5]};
        const Matrix3 r = rotation_about(normalized(turn), std::min(norm(turn), 0.2));
        // About the middle of the later readings.
        const Vector3 at = centre - Point3{};
        back = {nearest_rotation(r * back.rotation), r * (back.translation - at) + at + shift};
    }
    return back;
}

struct Tried {
    std::size_t first_after = 0;
    Rigid back;
    double gap2 = 0, closed2 = 0;
    std::size_t pairs = 0;
    std::size_t smaller_part = 1;
    double gain() const { return gap2 / std::max(closed2, 1e-6); }
    // Twice the logarithm of the ratio of likelihoods, if each pair told for itself.
    double evidence() const {
        return pairs < kMinPairs ? 0 : static_cast<double>(pairs) * std::log(gain());
    }
};

Tried tried_at(std::span<const Point3> points, std::size_t first_after) {
    Tried t;
    t.first_after = first_after;
    const Part earlier = part_of(points.first(first_after)),
               later = part_of(points.subspan(first_after));
    t.back = motion_of(earlier, later, {}, Cubes::all);
    const auto mean_of = [&](const Rigid& back, Cubes cubes, std::size_t* count) {
        double sum = 0;
        for (const Pair& pair : pairs_of(earlier, later, back)) {
            if (!counts(pair, cubes)) continue;
            sum += robust(pair.gap_mm, kFirstLossMm);
            ++*count;
        }
        return sum;
    };
    t.gap2 = mean_of({}, Cubes::all, &t.pairs);
    std::size_t closed = 0;
    t.closed2 = mean_of(motion_of(earlier, later, {}, Cubes::even), Cubes::odd, &closed) +
                mean_of(motion_of(earlier, later, {}, Cubes::odd), Cubes::even, &closed);
    t.gap2 /= static_cast<double>(std::max<std::size_t>(1, t.pairs));
    t.closed2 /= static_cast<double>(std::max<std::size_t>(1, closed));
    t.pairs = std::min(t.pairs, closed);
    t.smaller_part = std::min(first_after, points.size() - first_after);
    return t;
}

// The place in the order from which on readings fit the others best if they are moved back: any two
// neighbours of which the motion parts one from the other have a smaller gap then, and any others a
// larger one.
std::size_t turning_point(std::span<const Point3> points, const Tried& t) {
    const Part whole = part_of(points), earlier = part_of(points.first(t.first_after)),
               later = part_of(points.subspan(t.first_after));
    const double spacing_mm = 0.5 * (earlier.spacing_mm + later.spacing_mm);
    std::vector<double> gain(points.size() + 1, 0);  // differences along the order
    for (std::size_t j = 1; j < points.size(); ++j) {
        const Point3 moved = t.back * points[j];
        std::vector<std::uint32_t> near = whole.index.nearest(points[j], kCompared);
        for (const std::uint32_t i : whole.index.nearest(moved, kCompared)) near.push_back(i);
        std::sort(near.begin(), near.end());
        near.erase(std::unique(near.begin(), near.end()), near.end());
        for (const std::uint32_t i : near) {
            if (i >= j) continue;
            const Vector3 n =
                i < t.first_after ? earlier.normals[i] : later.normals[i - t.first_after];
            const Vector3 here = points[j] - points[i], there = moved - points[i];
            const double gap = dot(n, here), closed = dot(n, there);
            if (is_beside(here, gap, 2 * spacing_mm) || is_beside(there, closed, 2 * spacing_mm))
                continue;
            // The pair is parted by a motion after i and not after j.
            const double less = robust(gap, kLastLossMm) - robust(closed, kLastLossMm);
            gain[i + 1] += less;
            gain[j + 1] -= less;
        }
    }
    std::partial_sum(gain.begin(), gain.end(), gain.begin());
    return static_cast<std::size_t>(std::max_element(gain.begin(), gain.end()) - gain.begin());
}

}  // namespace

SweepMotion find_sweep_motion(const TargetSurface& target) {
    SweepMotion motion;
    if (!target.triangles.empty()) return motion;
    const std::size_t stride = (target.points.size() + kMaxPoints - 1) / kMaxPoints;
    std::vector<Point3> points;
    for (std::size_t i = 0; i < target.points.size(); i += stride)
        points.push_back(target.points[i]);
    if (points.size() < 2 * kMinPart) return motion;
    std::vector<Tried> tried(kPlaces);
    parallel_for(tried.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const std::size_t at = (n + 1) * points.size() / (kPlaces + 1);
            if (std::min(at, points.size() - at) >= kMinPart) tried[n] = tried_at(points, at);
        }
    });
    Tried best = *std::max_element(tried.begin(), tried.end(), [](const Tried& a, const Tried& b) {
        return a.evidence() < b.evidence();
    });
    if (best.evidence() <= 0) return motion;
    for (int round = 0; round < 3; ++round) {
        const std::size_t at = turning_point(points, best);
        if (at == best.first_after || std::min(at, points.size() - at) < kMinPart) break;
        const Tried nearer = tried_at(points, at);
        // Elsewhere there may be more pairs, of readings that lie on the wrong side of the motion.
        if (nearer.evidence() < 0.5 * best.evidence()) break;
        best = nearer;
    }
    Vector3 middle;
    const auto later = std::span(points).subspan(best.first_after);
    for (const Point3 p : later)
        middle = middle + (p - Point3{}) / static_cast<double>(later.size());
    motion.first_after = best.first_after * stride;
    motion.shift_mm = distance(best.back * (Point3{} + middle), Point3{} + middle);
    motion.turn_deg = rotation_angle(best.back.rotation) * kDegPerRad;
    motion.gap_mm = std::sqrt(best.gap2);
    motion.closed_gap_mm = std::sqrt(best.closed2);
    double moved2 = 0;
    for (const Point3 p : later) {
        const Vector3 d = best.back * p - p;
        moved2 += dot(d, d) / static_cast<double>(later.size());
    }
    motion.evidence = best.evidence();
    motion.overlap = static_cast<double>(best.pairs) / static_cast<double>(best.smaller_part);
    motion.found = best.gain() > kMinGain && motion.evidence > kMinEvidence &&
                   best.gap2 - best.closed2 > kMinClosedMm * kMinClosedMm &&
                   std::sqrt(moved2) > kMinMotionMm;
    return motion;
}

}  // namespace sonocase::pipeline::inline registration_fit
