// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/quadratic_warp.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Dense>

#include "formats/base/random.h"
#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/map_proofs.h"

namespace sonocase::pipeline::inline registration_fit {

namespace {

// The rows of the least-squares systems. The 30 unknowns are the 10 coefficients of each dimension
// of K in turn; the last column of a system is the right-hand side.
using Row10 = Eigen::Matrix<double, 1, 10>;
using Rows = Eigen::MatrixXd;  // 31 columns

// The coordinate w = R x / scale of a skin point.
Vector3 scaled(const RigidQuadratic& q, Point3 skin) {
    return (q.rigid.rotation * (skin - Point3{})) / q.scale_mm;
}

// b(w) of eq. (3).
Row10 basis(Vector3 w) {
    Row10 b;
    b << 1, w.x, w.y, w.z, w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.x * w.z, w.y * w.z;
    return b;
}

// The constraint rows of many points reduced to ten: the triangular factor of the stacked slopes,
// and the right-hand sides of the three dimensions.
struct ConstraintRows {
    Eigen::Matrix<double, 10, 10> left = Eigen::Matrix<double, 10, 10>::Zero();
    Eigen::Matrix<double, 10, 3> right = Eigen::Matrix<double, 10, 3>::Zero();
};

// d basis / d w
Eigen::Matrix<double, 3, 10> basis_slopes(Vector3 w) {
    Eigen::Matrix<double, 3, 10> d;
    d << 0, 1, 0, 0, 2 * w.x, 0, 0, w.y, w.z, 0,  //
        0, 0, 1, 0, 0, 2 * w.y, 0, w.x, 0, w.z,   //
        0, 0, 0, 1, 0, 0, 2 * w.z, 0, w.x, w.y;
    return d;
}

Vector3 mean_turn_column(const std::array<std::array<double, 10>, 3>& k, Vector3 w, int axis) {
    Vector3 column;
    for (int r = 0; r < 3; ++r) {
        const auto& c = k[r];
        const double slopes[3] = {c[1] + 2 * c[4] * w.x + c[7] * w.y + c[8] * w.z,
                                  c[2] + 2 * c[5] * w.y + c[7] * w.x + c[9] * w.z,
                                  c[3] + 2 * c[6] * w.z + c[8] * w.x + c[9] * w.y};
        column[r] = slopes[axis];
    }
    return column;
}

// Rows of weight_mm^2 * (sum over points of |dq/dz - I|^2) / divisor.
ConstraintRows constraint_rows(const RigidQuadratic& q,
                               std::span<const Point3> skin,
                               double weight_mm,
                               double divisor) {
    Eigen::MatrixXd stacked(3 * static_cast<Eigen::Index>(skin.size()), 13);
    const double w = weight_mm / std::sqrt(divisor);
    for (std::size_t i = 0; i < skin.size(); ++i) {
        const auto at = 3 * static_cast<Eigen::Index>(i);
        stacked.block<3, 10>(at, 0) = (w / q.scale_mm) * basis_slopes(scaled(q, skin[i]));
        stacked.block<3, 3>(at, 10) = w * Eigen::Matrix3d::Identity();
    }
    ConstraintRows rows;
    const Eigen::Index kept = std::min<Eigen::Index>(stacked.rows(), 10);
    Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(stacked);
    const Eigen::MatrixXd r = qr.matrixQR().topRows(kept).triangularView<Eigen::Upper>();
    rows.left.topRows(kept) = r.leftCols(10);
    rows.right.topRows(kept) = r.rightCols(3);
    return rows;
}

// The mean rotation of the map beyond that of the rigid pose. The constraint is taken about it:
// "rigid" in (4)-(6) must not mean the tilt at which the rigid fit of two unlike bodies ended.
Matrix3 mean_turn(const RigidQuadratic& q, const std::vector<Point3>& held) {
    Vector3 sum[3];
    for (Point3 p : held) {
        const Vector3 w = scaled(q, p);
        for (int axis = 0; axis < 3; ++axis) sum[axis] = sum[axis] + mean_turn_column(q.k, w, axis);
    }
    const double unit = 1 / (q.scale_mm * static_cast<double>(held.size()));
    return nearest_rotation(Matrix3::from_columns(unit * sum[0], unit * sum[1], unit * sum[2]));
}

Matches match_quadratic(const SkinModel& skin,
                        const TargetSurface& target,
                        std::span<const std::uint32_t> readings,
                        const RigidQuadratic& q,
                        int skin_queries,
                        double gate_mm) {
    MatchOptions gates;
    gates.farthest_mm = gate_mm;
    gates.side_step_mm = 1.2 * target.spacing_mm;
    const MappedSkin mapped = map_skin(skin, q);
    const std::size_t stride = std::max<std::size_t>(
        1, skin.points.size() / static_cast<std::size_t>(std::max(1, skin_queries)));
    return find_matches(skin, mapped.points, mapped.normals, mapped.index, target, readings, stride,
                        gates);
}

// One weighted row per match: w n . (K b) = w n . place. Both directions have the same total
// weight.
Rows gap_rows(const SkinModel& skin,
              const RigidQuadratic& q,
              const Matches& matches,
              double loss_mm) {
    Rows rows(static_cast<Eigen::Index>(matches.from_target.size() + matches.from_skin.size()), 31);
    Eigen::Index row = 0;
    for (const auto* list : {&matches.from_target, &matches.from_skin}) {
        const double share = 1 / static_cast<double>(std::max<std::size_t>(1, list->size()));
        for (const Match& m : *list) {
            const double w = std::sqrt(share / (1 + m.gap_mm * m.gap_mm / (loss_mm * loss_mm)));
            const Row10 basis_row = basis(scaled(q, skin.points[m.skin]));
            for (int d = 0; d < 3; ++d)
                rows.block<1, 10>(row, 10 * d) = w * m.normal[d] * basis_row;
            rows(row++, 30) = w * dot(m.normal, m.place - Point3{});
        }
    }
    return rows;
}

// The rows of the landmarks, and of the constraint about `turn`.
Rows held_rows(const RigidQuadratic& q,
               const RefineOptions& options,
               const ConstraintRows& constraint,
               const Matrix3& turn) {
    Rows rows = Rows::Zero(3 * static_cast<Eigen::Index>(options.landmarks.size()) + 30, 31);
    Eigen::Index row = 0;
    for (const Correspondence& c : options.landmarks) {
        const Vector3 r = map_point(q, c.skin) - c.place;
        const double w = std::sqrt(2 * options.landmark_weight / (1 + dot(r, r) / (30 * 30)));
        const Row10 basis_row = basis(scaled(q, c.skin));
        for (int d = 0; d < 3; ++d, ++row) {
            rows.block<1, 10>(row, 10 * d) = w * basis_row;
            rows(row, 30) = w * c.place[d];
        }
    }
    for (int d = 0; d < 3; ++d) {
        rows.block<10, 10>(row + 10 * d, 10 * d) = constraint.left;
        for (int e = 0; e < 3; ++e)
            rows.block<10, 1>(row + 10 * d, 30) += turn(d, e) * constraint.right.col(e);
    }
    return rows;
}

// The triangular factor of the rows with the right-hand side (31 x 31): all that a fit needs.
Rows triangle(Rows rows) {
    const Eigen::Index kept = std::min<Eigen::Index>(rows.rows(), 31);
    Eigen::HouseholderQR<Eigen::Ref<Rows>> qr(rows);
    Rows out = Rows::Zero(31, 31);
    out.topRows(kept) = qr.matrixQR().topRows(kept).triangularView<Eigen::Upper>();
    return out;
}

Eigen::VectorXd solution(const Rows& factor) {
    return factor.topLeftCorner(30, 30).triangularView<Eigen::Upper>().solve(
        factor.topRightCorner(30, 1));
}

Rows stacked(const std::vector<const Rows*>& parts) {
    Eigen::Index count = 0;
    for (const Rows* p : parts) count += p->rows();
    Rows all(count, 31);
    count = 0;
    for (const Rows* p : parts) {
        all.middleRows(count, p->rows()) = *p;
        count += p->rows();
    }
    return all;
}

}  // namespace

std::vector<Point3> subsample(const std::vector<Point3>& points, std::size_t count) {
    std::vector<Point3> some;
    const std::size_t stride =
        std::max<std::size_t>(1, points.size() / std::max<std::size_t>(1, count));
    for (std::size_t i = 0; i < points.size(); i += stride) some.push_back(points[i]);
    return some;
}

RigidQuadratic RigidQuadratic::from_rigid(const Rigid& rigid) {
    RigidQuadratic q;
    q.rigid = rigid;
    for (int r = 0; r < 3; ++r) {
        q.k[r][0] = rigid.translation[r];
        q.k[r][r + 1] = q.scale_mm;
    }
    return q;
}

Point3 map_point(const RigidQuadratic& q, Point3 skin) {
    const Vector3 w = scaled(q, skin);
    Point3 out;
    for (int r = 0; r < 3; ++r) {
        const auto& k = q.k[r];
        out[r] = k[0] + k[1] * w.x + k[2] * w.y + k[3] * w.z + k[4] * w.x * w.x + k[5] * w.y * w.y +
                 k[6] * w.z * w.z + k[7] * w.x * w.y + k[8] * w.x * w.z + k[9] * w.y * w.z;
    }
    return out;
}

Matrix3 jacobian(const RigidQuadratic& q, Point3 skin) {
    const Vector3 w = scaled(q, skin);
    Matrix3 j;
    for (int r = 0; r < 3; ++r) {
        const auto& k = q.k[r];
        j(r, 0) = (k[1] + 2 * k[4] * w.x + k[7] * w.y + k[8] * w.z) / q.scale_mm;
        j(r, 1) = (k[2] + 2 * k[5] * w.y + k[7] * w.x + k[9] * w.z) / q.scale_mm;
        j(r, 2) = (k[3] + 2 * k[6] * w.z + k[8] * w.x + k[9] * w.y) / q.scale_mm;
    }
    return j * q.rigid.rotation;
}

QuadraticMap in_frames(const RigidQuadratic& q, Point3 skin_origin, Point3 target_origin) {
    QuadraticMap map;
    map.centre_mm = skin_origin;
    map.scale_mm = q.scale_mm;
    const Matrix3& rotation = q.rigid.rotation;
    for (int r = 0; r < 3; ++r) {
        const auto& k = q.k[r];
        auto& out = map.coefficients[r];
        out[0] = k[0] + target_origin[r];
        const Vector3 linear = transpose(rotation) * Vector3{k[1], k[2], k[3]};
        Matrix3 s;  // w^T s w, w = R u
        s.m = {k[4], k[7] / 2, k[8] / 2, k[7] / 2, k[5], k[9] / 2, k[8] / 2, k[9] / 2, k[6]};
        const Matrix3 t = transpose(rotation) * s * rotation;
        out[1] = linear.x;
        out[2] = linear.y;
        out[3] = linear.z;
        out[4] = t(0, 0);
        out[5] = t(1, 1);
        out[6] = t(2, 2);
        out[7] = 2 * t(0, 1);
        out[8] = 2 * t(0, 2);
        out[9] = 2 * t(1, 2);
    }
    return map;
}

RigidQuadratic fit_correspondences(std::span<const Correspondence> pairs,
                                   const Rigid& rigid,
                                   double constraint_mm) {
    RigidQuadratic q = RigidQuadratic::from_rigid(rigid);
    std::vector<Point3> skin;
    for (const Correspondence& c : pairs) skin.push_back(c.skin);
    const ConstraintRows rows = constraint_rows(q, skin, constraint_mm, 1);
    const auto count = static_cast<Eigen::Index>(pairs.size());
    Eigen::MatrixXd a(count + 10, 10);
    Eigen::MatrixXd b(count + 10, 3);
    for (Eigen::Index i = 0; i < count; ++i) {
        const Correspondence& c = pairs[i];
        a.row(i) = basis(scaled(q, c.skin));
        b.row(i) << c.place.x, c.place.y, c.place.z;
    }
    a.bottomRows(10) = rows.left;
    b.bottomRows(10) = rows.right;
    // Rank-revealing: directions that repeated points leave undetermined stay at zero.
    const Eigen::MatrixXd k = a.completeOrthogonalDecomposition().solve(b);
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 10; ++c) {
            q.k[r][c] = k(c, r);
        }
    }
    return q;
}

double proven_min_det(const RigidQuadratic& q, const Box3& box) {
    Registration r;
    r.quadratic = in_frames(q, {}, {});
    r.ct_box = box;
    return prove_no_fold(r).min_bound;
}

MappedSkin map_skin(const SkinModel& skin, const RigidQuadratic& q) {
    MappedSkin mapped;
    mapped.points.resize(skin.points.size());
    mapped.normals.resize(skin.points.size());
    parallel_for(skin.points.size(), 1024, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            mapped.points[i] = map_point(q, skin.points[i]);
            const Matrix3 j = jacobian(q, skin.points[i]);
            mapped.normals[i] = normalized(transpose(inverse(j)) * skin.normals[i]);
        }
    });
    mapped.index = PointIndex(mapped.points);
    return mapped;
}

// The paper's random sample consensus, eqs. (7)-(9).
namespace {

// A pair that eqs. (7)-(8) allow, by index.
struct Entry {
    std::uint32_t volume, place;
};

// N_v points of the skin, N_m of the mannequin, and the search among the latter.
struct Samples {
    std::vector<Point3> volume, places;
    PointIndex index;
};

Samples sample_points(const SkinModel& skin,
                      const TargetSurface& target,
                      const RansacOptions& options) {
    Samples samples;
    std::vector<Point3> inner;
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
        if (!skin.on_rim[i]) inner.push_back(skin.points[i]);
    }
    samples.volume = subsample(inner, static_cast<std::size_t>(std::max(1, options.skin_points)));
    for (std::size_t j = 0; j < target.points.size(); ++j) {
        if (!target.lifted[j]) samples.places.push_back(target.points[j]);
    }
    if (!samples.volume.empty() && !samples.places.empty())
        samples.index = PointIndex(samples.places);
    return samples;
}

double mean_distance_from_centroid(const std::vector<Point3>& places) {
    Vector3 sum;
    for (Point3 p : places) sum = sum + (p - Point3{});
    const Point3 centroid = Point3{} + sum / static_cast<double>(places.size());
    double mean_distance = 0;
    for (Point3 p : places)
        mean_distance += distance(p, centroid) / static_cast<double>(places.size());
    return mean_distance;
}

// Eqs. (7)-(8): the true entries of the N_v x N_m matrix, row by row.
std::vector<Entry> allowed_pairs(const Samples& samples, const Rigid& rigid, double match_ratio) {
    const std::vector<Point3>&volume = samples.volume, &places = samples.places;
    const PointIndex& index = samples.index;
    std::vector<std::vector<Entry>> by_row(volume.size());
    parallel_for(volume.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
            const Point3 p = rigid * volume[v];
            double nearest2 = 0;
            index.nearest(p, &nearest2);
            const double limit2 = match_ratio * match_ratio * nearest2;
            for (std::size_t m = 0; m < places.size(); ++m) {
                const Vector3 d = places[m] - p;
                if (dot(d, d) < limit2) {
                    by_row[v].push_back(
                        {static_cast<std::uint32_t>(v), static_cast<std::uint32_t>(m)});
                }
            }
        }
    });
    std::vector<Entry> entries;
    for (const auto& row : by_row) entries.insert(entries.end(), row.begin(), row.end());
    return entries;
}

// Eq. (9): the share of mapped skin points within consensus_mm of a mannequin point.
double consensus(const RigidQuadratic& q, const Samples& samples, double consensus_mm) {
    int near = 0;
    for (Point3 v : samples.volume) {
        double d2 = 0;
        samples.index.nearest(map_point(q, v), &d2);
        near += d2 < consensus_mm * consensus_mm;
    }
    return near / static_cast<double>(samples.volume.size());
}

// The pairs that trial `t` draws.
std::vector<Correspondence> draw_pairs(const Samples& samples,
                                       const std::vector<Entry>& entries,
                                       const RansacOptions& options,
                                       std::size_t t) {
    RandomStream random(options.seed * kGoldenGamma + t);
    std::vector<Correspondence> sample;
    for (int n = 0; n < options.correspondences; ++n) {
        const Entry e = entries[random.below(entries.size())];
        sample.push_back({samples.volume[e.volume], samples.places[e.place]});
    }
    return sample;
}

// Fits again to all closest pairs within consensus_mm; keeps the better map.
void re_estimate(const Samples& samples,
                 const Rigid& rigid,
                 const Box3& box,
                 double constraint_mm,
                 RansacResult& result) {
    std::vector<Correspondence> pairs;
    for (Point3 v : samples.volume) {
        double d2 = 0;
        const std::uint32_t m = samples.index.nearest(map_point(result.map, v), &d2);
        if (d2 < result.consensus_mm * result.consensus_mm) pairs.push_back({v, samples.places[m]});
    }
    if (pairs.size() >= 10) {
        const RigidQuadratic again = fit_correspondences(pairs, rigid, constraint_mm);
        const double c = consensus(again, samples, result.consensus_mm);
        if (c > result.consensus && proven_min_det(again, box) > kMinDetJacobian) {
            result.map = again;
            result.consensus = c;
            result.re_estimated = true;
        }
    }
}

}  // namespace

RansacResult ransac_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              const Rigid& rigid,
                              const Box3& box,
                              const RansacOptions& options,
                              const Progress& progress) {
    RansacResult result;
    result.map = RigidQuadratic::from_rigid(rigid);
    const Samples samples = sample_points(skin, target, options);
    if (samples.volume.empty() || samples.places.empty()) return result;
    result.consensus_mm = options.consensus_share * mean_distance_from_centroid(samples.places);
    const std::vector<Entry> entries = allowed_pairs(samples, rigid, options.match_ratio);
    result.rigid_consensus = result.consensus = consensus(result.map, samples, result.consensus_mm);
    if (entries.empty() || options.trials <= 0) return result;

    struct Trial {
        RigidQuadratic map;
        double consensus = -1;
        bool folds = false;
    };
    std::vector<Trial> trials(options.trials);
    parallel_for(trials.size(), 2, [&](std::size_t begin, std::size_t end) {
        for (std::size_t t = begin; t < end; ++t) {
            trials[t].map = fit_correspondences(draw_pairs(samples, entries, options, t), rigid,
                                                options.constraint_mm);
            if (!(proven_min_det(trials[t].map, box) > kMinDetJacobian)) {
                trials[t].folds = true;
                continue;
            }
            trials[t].consensus = consensus(trials[t].map, samples, result.consensus_mm);
        }
    });
    report_progress(progress, 0.8, "quadratic warp: trials done");
    for (std::size_t t = 0; t < trials.size(); ++t) {
        result.folding_trials += trials[t].folds;
        result.best_trial_consensus = std::max(result.best_trial_consensus, trials[t].consensus);
        if (trials[t].consensus > result.consensus) {
            result.consensus = trials[t].consensus;
            result.map = trials[t].map;
            result.best_trial = static_cast<int>(t);
        }
    }
    re_estimate(samples, rigid, box, options.constraint_mm, result);
    return result;
}

RefineResult refine_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              std::span<const std::uint32_t> readings,
                              const RigidQuadratic& start,
                              const RefineOptions& options) {
    RefineResult result;
    result.map = start;
    RigidQuadratic& q = result.map;
    const std::vector<Point3> held = subsample(skin.points, 800);
    const ConstraintRows constraint =
        constraint_rows(q, held, options.constraint_mm, static_cast<double>(held.size()));
    for (int n = 0; n < options.iterations; ++n) {
        const double t =
            options.iterations > 1 ? static_cast<double>(n) / (options.iterations - 1) : 1;
        const double loss =
            options.first_loss_mm * std::pow(options.last_loss_mm / options.first_loss_mm, t);
        const double gate =
            options.first_gate_mm + t * (options.last_gate_mm - options.first_gate_mm);
        const Matches matches =
            match_quadratic(skin, target, readings, q, options.skin_queries, gate);
        if (matches.from_target.size() + matches.from_skin.size() < 30) break;
        const Rows gaps = gap_rows(skin, q, matches, loss);
        const Rows rest = held_rows(q, options, constraint, mean_turn(q, held));
        const Rows factor = triangle(stacked({&gaps, &rest}));
        if (n + 1 == options.iterations) {
            const Eigen::JacobiSVD<Eigen::MatrixXd> svd(factor.topLeftCorner(30, 30));
            result.condition = svd.singularValues()[0] / svd.singularValues()[29];
        }
        const Eigen::VectorXd k = solution(factor);
        if (!k.allFinite()) break;
        for (int d = 0; d < 3; ++d) {
            for (int c = 0; c < 10; ++c) {
                q.k[d][c] = k[10 * d + c];
            }
        }
    }
    const Matrix3 turn = mean_turn(q, held);
    for (int d = 0; d < 3; ++d) {
        Eigen::Matrix<double, 10, 1> off;
        for (int c = 0; c < 10; ++c) off[c] = q.k[d][c];
        off = constraint.left * off;
        for (int e = 0; e < 3; ++e) off -= turn(d, e) * constraint.right.col(e);
        result.constraint_cost += off.squaredNorm();
    }
    return result;
}

namespace {

constexpr double kFarGapMm = 8;  // larger gaps count as this where maps are compared
constexpr double kPatchMm = 60;
constexpr int kFolds = 5;

// The number of each place's patch: cubes of the mannequin's frame, numbered in sorted order.
std::vector<int> patches_of(const Matches& matches, int* count) {
    std::vector<std::array<int, 3>> cube;
    for (const auto* list : {&matches.from_target, &matches.from_skin}) {
        for (const Match& m : *list) {
            std::array<int, 3> c{};
            for (int a = 0; a < 3; ++a) c[a] = static_cast<int>(std::floor(m.place[a] / kPatchMm));
            cube.push_back(c);
        }
    }
    std::vector<std::array<int, 3>> distinct = cube;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    *count = static_cast<int>(distinct.size());
    std::vector<int> number;
    for (const auto& c : cube) {
        number.push_back(static_cast<int>(std::lower_bound(distinct.begin(), distinct.end(), c) -
                                          distinct.begin()));
    }
    return number;
}

// Variance of the mean gap if the gaps of one patch go together: the patches, not the readings, are
// the independent evidence. Gaps are clipped at +-limit.
double mean_gap_variance(const std::vector<double>& gaps,
                         const std::vector<int>& patch,
                         int patches,
                         double limit) {
    const auto clipped = [limit](double g) { return std::clamp(g, -limit, limit); };
    std::vector<double> sum(patches, 0), count = sum;
    for (std::size_t i = 0; i < gaps.size(); ++i) {
        sum[patch[i]] += clipped(gaps[i]);
        count[patch[i]] += 1;
    }
    double variance = 0;
    for (std::size_t p = 0; p < sum.size(); ++p) {
        const double share = sum[p] / static_cast<double>(gaps.size());
        variance += share * share;
    }
    return variance;
}

// The design effect (Kish 1965) of the first `count` gaps: the variance of their mean over what it
// would be if each gap were a draw of its own. 1: only noise is left.
double design_effect_of(std::vector<double> gaps,
                        std::vector<int> patch,
                        std::size_t count,
                        int patches,
                        double limit) {
    gaps.resize(count);
    patch.resize(count);
    double independent = 0;
    for (const double g : gaps) {
        const double share = std::clamp(g, -limit, limit) / static_cast<double>(count);
        independent += share * share;
    }
    return mean_gap_variance(gaps, patch, patches, limit) / std::max(independent, 1e-300);
}

// Root mean squared gaps, as fitted and with each fold of patches mapped by the fit to the others.
void cross_validate(const SkinModel& skin,
                    const RigidQuadratic& q,
                    const Matches& matches,
                    const std::vector<int>& patch,
                    const Rows& all,
                    const Rows& rest,
                    QuadraticTrust& trust) {
    std::vector<Rows> fold(kFolds);
    for (int f = 0; f < kFolds; ++f) {
        Eigen::Index n = 0;
        Rows rows(all.rows(), 31);
        for (Eigen::Index i = 0; i < all.rows(); ++i) {
            if (patch[i] % kFolds == f) rows.row(n++) = all.row(i);
        }
        fold[f] = triangle(rows.topRows(n));
    }
    double left_out = 0, fitted = 0;
    for (int f = 0; f < kFolds; ++f) {
        std::vector<const Rows*> others{&rest};
        for (int g = 0; g < kFolds; ++g) {
            if (g != f) others.push_back(&fold[g]);
        }
        const Eigen::VectorXd k = solution(triangle(stacked(others)));
        std::size_t i = 0;
        for (const auto* list : {&matches.from_target, &matches.from_skin}) {
            for (const Match& m : *list) {
                if (patch[i++] % kFolds != f) continue;
                const Row10 b = basis(scaled(q, skin.points[m.skin]));
                double gap = -dot(m.normal, m.place - Point3{});
                for (int d = 0; d < 3; ++d) gap += m.normal[d] * b.dot(k.segment<10>(10 * d));
                const double share = 0.5 / static_cast<double>(list->size());
                const double held_out = std::min(std::abs(gap), kFarGapMm);
                const double here = std::min(std::abs(m.gap_mm), kFarGapMm);
                left_out += share * held_out * held_out;
                fitted += share * here * here;
            }
        }
    }
    trust.held_out_mm = std::sqrt(left_out);
    trust.fitted_mm = std::sqrt(fitted);
}

constexpr int kDraws = 200;  // their spread is then known to 5 % of itself

// Maps drawn from the posterior; scale2 is the variance of one row of `factor`. The normal deviates
// are sums of twelve uniform ones: logarithms and cosines differ between machines.
std::vector<RigidQuadratic> draw_maps(const RigidQuadratic& q, const Rows& factor, double scale2) {
    RandomStream random(1);
    std::vector<RigidQuadratic> draws(kDraws, q);
    for (RigidQuadratic& draw : draws) {
        Eigen::VectorXd z = Eigen::VectorXd::Zero(30);
        for (Eigen::Index i = 0; i < 30; ++i) {
            for (int n = 0; n < 12; ++n) z[i] += random.unit();
            z[i] -= 6;
        }
        const Eigen::VectorXd off =
            std::sqrt(scale2) *
            factor.topLeftCorner(30, 30).triangularView<Eigen::Upper>().solve(z);
        for (int d = 0; d < 3; ++d) {
            for (int c = 0; c < 10; ++c) draw.k[d][c] += off[10 * d + c];
        }
    }
    return draws;
}

// Root mean squared posterior spread of the map at the points `inside`; scale2 is the variance of
// one row of `factor`.
double spread_inside(const RigidQuadratic& q,
                     const Rows& factor,
                     double scale2,
                     std::span<const Point3> inside) {
    const Eigen::MatrixXd back = factor.topLeftCorner(30, 30).triangularView<Eigen::Upper>().solve(
        Eigen::MatrixXd::Identity(30, 30));
    const Eigen::MatrixXd covariance = scale2 * back * back.transpose();
    Eigen::Matrix<double, 10, 10> blocks = Eigen::Matrix<double, 10, 10>::Zero();
    for (int d = 0; d < 3; ++d) blocks += covariance.block<10, 10>(10 * d, 10 * d);
    double spread = 0;
    for (Point3 p : inside) {
        const Row10 b = basis(scaled(q, p));
        spread += b.dot(b * blocks);
    }
    return std::sqrt(spread / static_cast<double>(inside.size()));
}

}  // namespace

QuadraticTrust trust_quadratic(const SkinModel& skin,
                               const TargetSurface& target,
                               std::span<const std::uint32_t> readings,
                               const RigidQuadratic& q,
                               const RefineOptions& options,
                               double strain,
                               std::span<const Point3> inside) {
    QuadraticTrust trust;
    const Matches matches =
        match_quadratic(skin, target, readings, q, options.skin_queries, options.last_gate_mm);
    std::vector<double> gaps;
    for (const auto* list : {&matches.from_target, &matches.from_skin}) {
        for (const Match& m : *list) gaps.push_back(m.gap_mm);
    }
    if (gaps.size() < 30) return trust;
    std::vector<double> size;
    for (double g : gaps) size.push_back(std::abs(g));
    std::nth_element(size.begin(), size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2),
                     size.end());
    trust.sigma_mm = 1.4826 * size[size.size() / 2];
    const double limit = std::max(3 * trust.sigma_mm, 1e-6);

    const std::vector<int> patch = patches_of(matches, &trust.patches);
    const double variance = mean_gap_variance(gaps, patch, trust.patches, limit);
    trust.standard_error_mm = std::sqrt(variance);
    trust.design_effect =
        design_effect_of(gaps, patch, matches.from_target.size(), trust.patches, limit);

    const Rows all = gap_rows(skin, q, matches, options.last_loss_mm);
    const std::vector<Point3> held = subsample(skin.points, 800);
    const ConstraintRows constraint =
        constraint_rows(q, held, options.constraint_mm, static_cast<double>(held.size()));
    const Rows rest = held_rows(q, options, constraint, mean_turn(q, held));
    cross_validate(skin, q, matches, patch, all, rest, trust);

    // Posterior spread inside the body, for slopes that vary by `strain` beforehand.
    const double scale2 =
        std::max(2 * variance, options.constraint_mm * options.constraint_mm * strain * strain);
    const Rows factor = triangle(stacked({&all, &rest}));
    if (!inside.empty()) trust.inside_mm = spread_inside(q, factor, scale2, inside);
    trust.draws = draw_maps(q, factor, scale2);
    return trust;
}

}  // namespace sonocase::pipeline::inline registration_fit
