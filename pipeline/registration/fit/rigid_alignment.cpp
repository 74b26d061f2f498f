// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/rigid_alignment.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <Eigen/Dense>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"
#include "pipeline/registration/fit/quadratic_warp.h"

namespace sonocase::pipeline::inline registration_fit {

namespace {

// A point without a counterpart costs as much as this gap, which is about the gap between two
// bodies after a rigid alignment: overlap as such is neither rewarded nor penalised.
constexpr double kNoCounterpartMm = 12;
constexpr double kScoreScaleMm = 10;
// Poses nearer to each other are one.
constexpr double kSamePoseRad = 20 * kPi / 180, kSamePoseMm = 40;

// The points of both surfaces that are matched; the skin that is searched may hold more points.
struct SurfacePair {
    const SkinModel& skin;
    PointIndex skin_index;
    std::vector<std::uint32_t> skin_queries;
    const TargetSurface& target;
    std::vector<std::uint32_t> target_queries;
};

std::vector<std::uint32_t> every_nth(const std::vector<std::uint32_t>& all, int count) {
    if (count <= 0 || all.size() <= static_cast<std::size_t>(count)) return all;
    std::vector<std::uint32_t> some;
    for (int n = 0; n < count; ++n) {
        some.push_back(
            all[static_cast<std::size_t>(n) * all.size() / static_cast<std::size_t>(count)]);
    }
    return some;
}

SurfacePair make_pair_of(const SkinModel& skin, const TargetSurface& target, int points) {
    SurfacePair pair{skin, PointIndex(skin.points), {}, target, {}};
    std::vector<std::uint32_t> all;
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
        if (!skin.on_rim[i]) all.push_back(static_cast<std::uint32_t>(i));
    }
    pair.skin_queries = every_nth(all, points);
    // Thinned evenly at 1.5 times the spacing first, then subsampled.
    pair.target_queries = every_nth(thin_target(target, 1.5 * target.spacing_mm), points);
    return pair;
}

// Cauchy, in mm^2 near zero.
double penalty(double gap, double scale) {
    return scale * scale * std::log1p(gap * gap / (scale * scale));
}

// The nearest point of each query at the pose before, or PointIndex::kNone.
struct Guesses {
    explicit Guesses(const SurfacePair& pair)
        : skin(pair.target_queries.size(), PointIndex::kNone),
          target(pair.skin_queries.size(), PointIndex::kNone) {}
    std::vector<std::uint32_t> skin, target;
};

// Calls row(from_target, p, n, gap) for every point with a counterpart, p on the moved skin,
// and missing(from_target) for the others.
template <class RowOf, class Missing>
void for_rows(const SurfacePair& pair,
              const Rigid& pose,
              double farthest_mm,
              Guesses& guesses,
              const RowOf& row,
              const Missing& missing) {
    const TargetSurface& target = pair.target;
    const Rigid back = inverse(pose);
    const double farthest2 = farthest_mm * farthest_mm;
    // Farther points are not searched for; on the bound the exact distance decides.
    const double within2 = farthest2 * (1 + 1e-9);
    for (std::size_t q = 0; q < pair.target_queries.size(); ++q) {
        double d2 = 0;
        const std::uint32_t j = pair.target_queries[q];
        const Point3 y = target.points[j];
        const std::uint32_t i =
            pair.skin_index.nearest_within(back * y, within2, guesses.skin[q], &d2);
        if (i == PointIndex::kNone) {
            missing(true);
            continue;
        }
        guesses.skin[q] = i;
        const Vector3 n = pose * pair.skin.normals[i];
        if (pair.skin.on_rim[i] || d2 > farthest2 || dot(n, target.normals[j]) < 0.3) {
            missing(true);
        } else {
            const Point3 p = pose * pair.skin.points[i];
            row(true, p, n, dot(n, p - y));
        }
    }
    const double side = 1.2 * target.spacing_mm;
    for (std::size_t q = 0; q < pair.skin_queries.size(); ++q) {
        const std::uint32_t i = pair.skin_queries[q];
        const Point3 p = pose * pair.skin.points[i];
        double d2 = 0;
        const std::uint32_t j = target.index.nearest_within(p, within2, guesses.target[q], &d2);
        if (j == PointIndex::kNone) {
            missing(false);
            continue;
        }
        guesses.target[q] = j;
        const Vector3 n = target.normals[j];
        const double gap = dot(n, p - target.points[j]);
        const double aside2 = d2 - gap * gap;
        // Far from the surface the nearest reading is seldom along the normal.
        const double limit = side + 0.7 * std::abs(gap);
        if (target.lifted[j] || d2 > farthest2 || dot(n, pose * pair.skin.normals[i]) < 0.3 ||
            aside2 > (target.on_rim[j] ? 0.15 : 1.0) * limit * limit) {
            missing(false);
        } else {
            row(false, p, n, gap);
        }
    }
}

// One robust Gauss-Newton step on the point-to-plane gaps.
Rigid step(const SurfacePair& pair,
           const PoseHints& hints,
           const Rigid& pose,
           double scale_mm,
           double farthest_mm,
           Guesses& guesses) {
    Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    // About the moved origin of the skin and in units of 100 mm, so that rotations and translations
    // have similar weight.
    const Point3 centre = pose * Point3{};
    constexpr double kUnit = 100;
    const double target_share = 1 / static_cast<double>(pair.target_queries.size());
    const double skin_share = 1 / static_cast<double>(pair.skin_queries.size());
    for_rows(
        pair, pose, farthest_mm, guesses,
        [&](bool from_target, Point3 p, Vector3 n, double gap) {
            const double w =
                (from_target ? target_share : skin_share) / (1 + gap * gap / (scale_mm * scale_mm));
            const Vector3 m = cross(p - centre, n) / kUnit;
            const Eigen::Matrix<double, 6, 1> r{m.x, m.y, m.z, n.x, n.y, n.z};
            a.noalias() += w * r * r.transpose();
            b -= w * gap * r;
        },
        [](bool) {});
    // The gaps are a sum of two means, so that hints count twice.
    for (const PoseHints::Place& place : hints.landmarks) {
        const Point3 p = pose * place.skin;
        const Vector3 r = p - place.target, arm = (p - centre) / kUnit;
        const double w = 2 * hints.landmark_weight / (1 + dot(r, r) / (60 * 60));
        for (int axis = 0; axis < 3; ++axis) {
            Vector3 n;
            n[axis] = 1;
            const Vector3 m = cross(arm, n);
            const Eigen::Matrix<double, 6, 1> row{m.x, m.y, m.z, n.x, n.y, n.z};
            a.noalias() += w * row * row.transpose();
            b -= w * r[axis] * row;
        }
    }
    if (hints.up) {
        const Vector3 head = pose.rotation.column(2), r = head - *hints.up;
        for (int axis = 0; axis < 3; ++axis) {
            Vector3 n;
            n[axis] = 1;
            const Vector3 m = cross(head, n) / kUnit;
            const Eigen::Matrix<double, 6, 1> row{m.x, m.y, m.z, 0, 0, 0};
            a.noalias() += 2 * hints.up_weight_mm2 * row * row.transpose();
            b -= 2 * hints.up_weight_mm2 * r[axis] * row;
        }
    }
    // A small penalty on every unknown keeps those at rest that the rows do not determine.
    a.diagonal().array() += 1e-4 * a.trace() / 6 + 1e-12;
    const Eigen::Matrix<double, 6, 1> x = a.ldlt().solve(b);
    const Vector3 turn{x[0] / kUnit, x[1] / kUnit, x[2] / kUnit};
    Vector3 shift{x[3], x[4], x[5]};
    if (norm(shift) > 60) shift = 60 * normalized(shift);
    const Matrix3 rotation = nearest_rotation(
        rotation_about(normalized(turn), std::min(norm(turn), 0.5)) * pose.rotation);
    return {rotation, (centre + shift) - Point3{}};  // the skin's origin goes to centre + shift
}

RigidCandidate scored(const SurfacePair& pair,
                      const PoseHints& hints,
                      const Rigid& pose,
                      Guesses& guesses) {
    double cost[2] = {0, 0};
    int counterparts = 0;
    for_rows(
        pair, pose, 60, guesses,
        [&](bool from_target, Point3, Vector3, double gap) {
            cost[from_target] += std::min(penalty(gap, kScoreScaleMm), 400.0);
            counterparts += from_target;
        },
        [&](bool from_target) { cost[from_target] += penalty(kNoCounterpartMm, kScoreScaleMm); });
    RigidCandidate c;
    c.target_from_skin = pose;
    c.score_mm = std::sqrt(0.5 * cost[1] / static_cast<double>(pair.target_queries.size()) +
                           0.5 * cost[0] / static_cast<double>(pair.skin_queries.size()) +
                           hints.cost_mm2(pose));
    c.coverage = counterparts / static_cast<double>(pair.target_queries.size());
    return c;
}

RigidCandidate descend(const SurfacePair& pair,
                       const PoseHints& hints,
                       Rigid pose,
                       int iterations,
                       double first_scale_mm,
                       double last_scale_mm) {
    Guesses guesses(pair);
    for (int n = 0; n < iterations; ++n) {
        const double t = iterations > 1 ? static_cast<double>(n) / (iterations - 1) : 1;
        const double scale = first_scale_mm * std::pow(last_scale_mm / first_scale_mm, t);
        const Rigid next = step(pair, hints, pose, scale, 6 * scale, guesses);
        const bool at_rest = same_pose(next, pose, 1e-5, 1e-3);
        pose = next;
        if (at_rest && n > iterations / 2) break;
    }
    return scored(pair, hints, pose, guesses);
}

// The readings' own axes, from the longest to the shortest, each towards its longer tail: starts
// that are laid in them depend neither on the tracker's frame nor on chance.
Matrix3 axes_of(const TargetSurface& target) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    const auto at = [&](std::size_t i) {
        const Point3 p = target.points[i];
        return Eigen::Vector3d{p.x, p.y, p.z};
    };
    double count = 0;
    for (std::size_t i = 0; i < target.points.size(); ++i) {
        if (target.lifted[i]) continue;
        mean += at(i);
        ++count;
    }
    if (count < 3) return {};
    mean /= count;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < target.points.size(); ++i) {
        if (target.lifted[i]) continue;
        const Eigen::Vector3d d = at(i) - mean;
        spread += d * d.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);
    Vector3 axis[2];
    for (int a = 0; a < 2; ++a) {
        const Eigen::Vector3d v = solver.eigenvectors().col(2 - a);
        double tail = 0;
        for (std::size_t i = 0; i < target.points.size(); ++i) {
            if (target.lifted[i]) continue;
            const double along = v.dot(at(i) - mean);
            tail += along * along * along;
        }
        axis[a] = (tail < 0 ? -1.0 : 1.0) * Vector3{v[0], v[1], v[2]};
    }
    return nearest_rotation(Matrix3::from_columns(axis[0], axis[1], cross(axis[0], axis[1])));
}

// Unit, perpendicular to v: along that axis which v is farthest from.
Vector3 perpendicular_to(Vector3 v, const Matrix3& axes) {
    Vector3 best = axes.column(0);
    for (int a = 1; a < 3; ++a)
        if (std::abs(dot(axes.column(a), v)) < std::abs(dot(best, v))) best = axes.column(a);
    return normalized(best - dot(best, v) * v);
}

// Rotations spread evenly over all (a super-Fibonacci spiral of quaternions, Alexa 2022), or over
// those that carry the head within a cone about `up`.
std::vector<Matrix3> spread_rotations(const RigidOptions& options, const Matrix3& axes) {
    const int count = std::max(1, options.starts);
    std::vector<Matrix3> rotations;
    if (options.hints.up) {
        // Head directions on rings of a cap, each with rotations about it.
        const Vector3 up = normalized(*options.hints.up);
        const Vector3 u = perpendicular_to(up, axes), v = cross(up, u);
        constexpr double kGolden = 2.39996322972865332;
        for (int n = 0; n < count; ++n) {
            const double s = (n % 8 + 0.5) / 8;
            const double tilt = options.cone_rad * std::sqrt(s) * 0.7;
            const double around = kGolden * n;
            const Vector3 head = std::cos(tilt) * up +
                                 std::sin(tilt) * (std::cos(around) * u + std::sin(around) * v);
            const Vector3 x = perpendicular_to(head, axes), y = cross(head, x);
            const double roll = 2 * kPi * n / count;
            const Vector3 right = std::cos(roll) * x + std::sin(roll) * y;
            rotations.push_back(Matrix3::from_columns(right, cross(head, right), head));
        }
        return rotations;
    }
    for (int n = 0; n < count; ++n) {
        const double s = n + 0.5, t = s / count;
        const double alpha = 2 * kPi * s / std::sqrt(2.0),
                     beta = 2 * kPi * s / 1.533751168755204288;
        rotations.push_back(axes * rotation_from_quaternion({std::sqrt(t) * std::sin(alpha),
                                                             std::sqrt(t) * std::cos(alpha),
                                                             std::sqrt(1 - t) * std::sin(beta),
                                                             std::sqrt(1 - t) * std::cos(beta)}));
    }
    return rotations;
}

// The shift that moves the turned skin to the readings, using only parts that face the same way:
// correct for a sweep of one side as well as of the whole body.
Vector3 facing_shift(const SurfacePair& pair, const Matrix3& rotation) {
    Vector3 sum;
    int count = 0;
    for (std::uint32_t j : pair.target_queries) {
        Vector3 mean;
        int facing = 0;
        for (std::uint32_t i : pair.skin_queries) {
            if (dot(rotation * pair.skin.normals[i], pair.target.normals[j]) < 0.8) continue;
            mean = mean + (pair.skin.points[i] - Point3{});
            ++facing;
        }
        if (facing == 0) continue;
        sum = sum + ((pair.target.points[j] - Point3{}) - rotation * (mean / facing));
        ++count;
    }
    return count > 0 ? sum / count : Vector3{};
}

// The best candidates that differ clearly from each other, at most max_count. Those that have slid
// off the readings come last: where bodies differ by more than a missing counterpart costs, they
// have the lowest scores of all.
std::vector<RigidCandidate> distinct(std::vector<RigidCandidate> all, int max_count) {
    double best_coverage = 0;
    for (const RigidCandidate& c : all) best_coverage = std::max(best_coverage, c.coverage);
    std::stable_sort(all.begin(), all.end(),
                     [best_coverage](const RigidCandidate& a, const RigidCandidate& b) {
                         const bool a_off = slid_off(a.coverage, best_coverage),
                                    b_off = slid_off(b.coverage, best_coverage);
                         return a_off == b_off ? a.score_mm < b.score_mm : b_off;
                     });
    std::vector<RigidCandidate> chosen;
    for (const RigidCandidate& c : all) {
        if (static_cast<int>(chosen.size()) >= max_count) break;
        const bool seen = std::any_of(chosen.begin(), chosen.end(), [&](const RigidCandidate& o) {
            return same_pose(o.target_from_skin, c.target_from_skin, kSamePoseRad, kSamePoseMm);
        });
        if (!seen) chosen.push_back(c);
    }
    return chosen;
}

}  // namespace

bool same_pose(const Rigid& a, const Rigid& b, double angle_rad, double shift_mm) {
    return norm(a.translation - b.translation) < shift_mm &&
           rotation_angle(transpose(a.rotation) * b.rotation) < angle_rad;
}

std::vector<RigidCandidate> align_rigid_candidates(const SkinModel& skin,
                                                   const TargetSurface& target,
                                                   const RigidOptions& options,
                                                   const Progress& progress) {
    const SurfacePair coarse = make_pair_of(skin, target, options.coarse_points);
    const std::vector<Matrix3> rotations = spread_rotations(options, axes_of(target));
    const int offsets = std::max(1, options.offsets);
    std::vector<RigidCandidate> found(rotations.size() * static_cast<std::size_t>(offsets));
    parallel_for(rotations.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const Vector3 shift = facing_shift(coarse, rotations[n]);
            for (int o = 0; o < offsets; ++o) {
                const double along = options.offset_mm * (o - 0.5 * (offsets - 1));
                const Rigid start{rotations[n], shift + along * rotations[n].column(2)};
                found[n * static_cast<std::size_t>(offsets) + static_cast<std::size_t>(o)] =
                    descend(coarse, options.hints, start, options.coarse_iterations, 25, 10);
            }
        }
    });
    report_progress(progress, 0.5, "rigid alignment: refining the best starts");
    std::vector<RigidCandidate> best = distinct(found, std::max(options.kept, 1));
    for (RigidCandidate& c : best) {
        c.found = static_cast<int>(
            std::count_if(found.begin(), found.end(), [&](const RigidCandidate& o) {
                return same_pose(o.target_from_skin, c.target_from_skin, kSamePoseRad, kSamePoseMm);
            }));
    }
    const SurfacePair fine = make_pair_of(skin, target, options.fine_points);
    parallel_for(best.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            const int times = best[n].found;
            best[n] = descend(fine, options.hints, best[n].target_from_skin,
                              options.fine_iterations, 12, 6);
            best[n].found = times;
        }
    });
    if (options.hints.up) {
        const Vector3 up = normalized(*options.hints.up);
        const double min_cosine = std::cos(options.cone_rad);
        std::vector<RigidCandidate> upright;
        for (const RigidCandidate& c : best) {
            if (dot(c.target_from_skin.rotation.column(2), up) >= min_cosine) upright.push_back(c);
        }
        if (!upright.empty()) best = upright;
    }
    return distinct(std::move(best), std::max(options.candidates, 1));
}

double PoseHints::back_cost_mm2(const Rigid& pose) const {
    if (!back) return 0;
    const Vector3 r = pose.rotation.column(1) + *back;  // the back is at -y
    return back_weight_mm2 * dot(r, r);
}

double PoseHints::cost_mm2(const Rigid& pose) const {
    double cost = back_cost_mm2(pose);
    for (const Place& place : landmarks) {
        const Vector3 r = pose * place.skin - place.target;
        cost += landmark_weight * std::min(dot(r, r), 60.0 * 60.0);
    }
    if (up) {
        const Vector3 r = pose.rotation.column(2) - *up;
        cost += up_weight_mm2 * dot(r, r);
    }
    return cost;
}

RigidCandidate refine_rigid(const SkinModel& skin,
                            const TargetSurface& target,
                            const Rigid& start,
                            const RigidOptions& options) {
    return descend(make_pair_of(skin, target, options.fine_points), options.hints, start,
                   options.fine_iterations, 12, 6);
}

// The rigid refinement by Ceres.
namespace {

template <class T>
void rotate(const T* turn, Vector3 v, T* to) {
    const T from[3] = {T(v.x), T(v.y), T(v.z)};
    ceres::AngleAxisRotatePoint(turn, from, to);
}

// weight (normal . (turn * p + shift - place)); p is the skin point rotated by the start.
struct Gap {
    Vector3 p, place, normal;
    double weight;
    template <class T>
    bool operator()(const T* turn, const T* shift, T* residual) const {
        T to[3];
        rotate(turn, p, to);
        residual[0] = weight * (normal.x * (to[0] + shift[0] - place.x) +
                                normal.y * (to[1] + shift[1] - place.y) +
                                normal.z * (to[2] + shift[2] - place.z));
        return true;
    }
};

struct Place {
    Vector3 p, place;
    double weight;
    template <class T>
    bool operator()(const T* turn, const T* shift, T* residual) const {
        T to[3];
        rotate(turn, p, to);
        residual[0] = weight * (to[0] + shift[0] - place.x);
        residual[1] = weight * (to[1] + shift[1] - place.y);
        residual[2] = weight * (to[2] + shift[2] - place.z);
        return true;
    }
};

struct Head {
    Vector3 head, up;
    double weight;
    template <class T>
    bool operator()(const T* turn, T* residual) const {
        T to[3];
        rotate(turn, head, to);
        residual[0] = weight * (to[0] - up.x);
        residual[1] = weight * (to[1] - up.y);
        residual[2] = weight * (to[2] - up.z);
        return true;
    }
};

template <class Cost, int... Sizes>
ceres::CostFunction* automatic(const Cost& cost) {
    return new ceres::AutoDiffCostFunction<Cost, Sizes...>(new Cost(cost));
}

constexpr int kSureRounds = 4;  // rounds of matching that no pose slides away in
// Poses are rounded to these, which are wide against what lies between two that rest (0.1 mm and
// 1e-4) and narrow against the body.
constexpr double kRoundedMm = 2, kRoundedCosine = 0.01;
constexpr double kSameCost = 1.01;  // a second descent that ends higher than this is not taken

// How near a descent comes to where it rests.
struct Nearness {
    double angle_rad, shift_mm;
    double cost;  // share of it that the solver stops at
};
constexpr Nearness kNear{1e-4, 0.02, 1e-6}, kExact{1e-5, 2e-3, 1e-10};

struct Settled {
    Rigid pose;
    double cost = INFINITY;  // half the sum of the robust gaps; of no pose that slid
    bool slid = false;       // it lost counterparts; the pose is that of before
};

Settled settle(const SkinModel& skin,
               const TargetSurface& target,
               std::span<const std::uint32_t> readings,
               const Rigid& start,
               const PoseHints& hints,
               double loss_mm,
               int rounds,
               const Nearness& nearness) {
    Rigid pose = start;
    const std::size_t stride = std::max<std::size_t>(1, skin.points.size() / 1200);
    std::size_t counterparts = 0;
    Rigid sure = start;  // the pose while every reading that has a counterpart keeps it
    double cost = INFINITY;
    for (int round = 0; round < rounds; ++round) {
        MatchOptions gates;
        gates.farthest_mm = 60;
        gates.side_step_mm = 1.2 * target.spacing_mm;
        const MappedSkin mapped = map_skin(skin, RigidQuadratic::from_rigid(pose));
        const Matches matches = find_matches(skin, mapped.points, mapped.normals, mapped.index,
                                             target, readings, stride, gates);
        const std::size_t found = matches.from_target.size() + matches.from_skin.size();
        if (found < 30) return {sure, INFINITY, true};
        // A pose that loses counterparts from round to round slides off the body.
        if (round == kSureRounds) counterparts = found;
        if (round <= kSureRounds) sure = pose;
        if (round > kSureRounds &&
            static_cast<double>(found) < 0.98 * static_cast<double>(counterparts))
            return {sure, INFINITY, true};
        double turn[3] = {0, 0, 0};
        double shift[3] = {pose.translation.x, pose.translation.y, pose.translation.z};
        ceres::Problem problem;
        const auto add = [&](const std::vector<Match>& list) {
            // Scaled after the loss, so that both directions have the same total weight.
            const double share = 1 / static_cast<double>(std::max<std::size_t>(1, list.size()));
            for (const Match& m : list) {
                const Vector3 p = pose.rotation * (skin.points[m.skin] - Point3{});
                auto* loss = new ceres::ScaledLoss(new ceres::CauchyLoss(loss_mm), share,
                                                   ceres::TAKE_OWNERSHIP);
                problem.AddResidualBlock(
                    automatic<Gap, 1, 3, 3>(Gap{p, m.place - Point3{}, m.normal, 1}), loss, turn,
                    shift);
            }
        };
        add(matches.from_target);
        add(matches.from_skin);
        for (const PoseHints::Place& place : hints.landmarks) {
            const Vector3 p = pose.rotation * (place.skin - Point3{});
            problem.AddResidualBlock(
                automatic<Place, 3, 3, 3>(
                    Place{p, place.target - Point3{}, std::sqrt(2 * hints.landmark_weight)}),
                new ceres::CauchyLoss(60 * std::sqrt(2 * hints.landmark_weight)), turn, shift);
        }
        if (hints.up) {
            problem.AddResidualBlock(
                automatic<Head, 3, 3>(
                    Head{pose.rotation.column(2), *hints.up, std::sqrt(2 * hints.up_weight_mm2)}),
                nullptr, turn);
        }
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_QR;
        options.max_num_iterations = 8;
        options.function_tolerance = nearness.cost;
        options.num_threads = 1;  // the order of summation affects the result
        options.logging_type = ceres::SILENT;
        ceres::Solver::Summary summary;
        ceres::Solve(options, &problem, &summary);
        if (!summary.IsSolutionUsable()) return {pose, cost};
        cost = summary.final_cost;
        const Vector3 axis{turn[0], turn[1], turn[2]};
        const Rigid next{
            nearest_rotation(rotation_about(normalized(axis), norm(axis)) * pose.rotation),
            {shift[0], shift[1], shift[2]}};
        const bool at_rest = same_pose(next, pose, nearness.angle_rad, nearness.shift_mm);
        pose = next;
        if (at_rest) break;
    }
    return {pose, cost};
}

// The nearest pose of a lattice in the readings' own axes.
Rigid rounded(const Rigid& pose, const Matrix3& axes) {
    const auto rounded = [](Vector3 v, double step) {
        for (int a = 0; a < 3; ++a) v[a] = step * std::round(v[a] / step);
        return v;
    };
    const Matrix3 to_axes = transpose(axes), turn = to_axes * pose.rotation;
    return {nearest_rotation(axes * Matrix3::from_columns(rounded(turn.column(0), kRoundedCosine),
                                                          rounded(turn.column(1), kRoundedCosine),
                                                          rounded(turn.column(2), kRoundedCosine))),
            axes * rounded(to_axes * pose.translation, kRoundedMm)};
}

}  // namespace

Rigid refine_rigid_robust(const SkinModel& skin,
                          const TargetSurface& target,
                          const Rigid& start,
                          const PoseHints& hints,
                          double loss_mm,
                          int rounds) {
    const std::vector<std::uint32_t> readings = thin_target(target, 1.2 * target.spacing_mm);
    const Settled near = settle(skin, target, readings, start, hints, loss_mm, rounds, kNear);
    if (near.slid) return near.pose;
    const Settled exact = settle(skin, target, readings, rounded(near.pose, axes_of(target)), hints,
                                 loss_mm, rounds, kExact);
    return exact.cost <= kSameCost * near.cost ? exact.pose : near.pose;
}

}  // namespace sonocase::pipeline::inline registration_fit
