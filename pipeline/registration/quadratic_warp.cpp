#include "pipeline/registration/quadratic_warp.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "pipeline/parallel.h"
#include "pipeline/registration/fold_proof.h"

namespace sonocase::pipeline {
namespace {

using Row10 = Eigen::Matrix<double, 1, 10>;

Vector3 scaled(const RigidQuadratic& q, Point3 skin) {
    return (q.rigid.rotation * (skin - Point3{})) / q.scale_mm;
}

Row10 basis(Vector3 w) {
    Row10 b;
    b << 1, w.x, w.y, w.z, w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.x * w.z, w.y * w.z;
    return b;
}

// d basis / d w
Eigen::Matrix<double, 3, 10> basis_slopes(Vector3 w) {
    Eigen::Matrix<double, 3, 10> d;
    d << 0, 1, 0, 0, 2 * w.x, 0, 0, w.y, w.z, 0,  //
        0, 0, 1, 0, 0, 2 * w.y, 0, w.x, 0, w.z,   //
        0, 0, 0, 1, 0, 0, 2 * w.z, 0, w.x, w.y;
    return d;
}

// The constraint rows of many points as ten: the triangular factor of the stacked slopes, with the
// right-hand sides of the three dimensions.
struct ConstraintRows {
    Eigen::Matrix<double, 10, 10> left = Eigen::Matrix<double, 10, 10>::Zero();
    Eigen::Matrix<double, 10, 3> right = Eigen::Matrix<double, 10, 3>::Zero();
};

// weight^2 * sum over points |dq/dz - I|^2 / divisor
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

std::vector<Point3> every_so_many(const std::vector<Point3>& points, std::size_t count) {
    std::vector<Point3> some;
    const std::size_t stride =
        std::max<std::size_t>(1, points.size() / std::max<std::size_t>(1, count));
    for (std::size_t i = 0; i < points.size(); i += stride) some.push_back(points[i]);
    return some;
}

}  // namespace

RigidQuadratic RigidQuadratic::from_rigid(const Rigid& rigid) {
    RigidQuadratic q;
    q.rigid = rigid;
    for (int r = 0; r < 3; ++r) {
        q.k[static_cast<std::size_t>(r)][0] = rigid.translation[r];
        q.k[static_cast<std::size_t>(r)][static_cast<std::size_t>(r + 1)] = q.scale_mm;
    }
    return q;
}

Point3 map_point(const RigidQuadratic& q, Point3 skin) {
    const Vector3 w = scaled(q, skin);
    Point3 out;
    for (int r = 0; r < 3; ++r) {
        const auto& k = q.k[static_cast<std::size_t>(r)];
        out[r] = k[0] + k[1] * w.x + k[2] * w.y + k[3] * w.z + k[4] * w.x * w.x + k[5] * w.y * w.y +
                 k[6] * w.z * w.z + k[7] * w.x * w.y + k[8] * w.x * w.z + k[9] * w.y * w.z;
    }
    return out;
}

Matrix3 jacobian(const RigidQuadratic& q, Point3 skin) {
    const Vector3 w = scaled(q, skin);
    Matrix3 j;
    for (int r = 0; r < 3; ++r) {
        const auto& k = q.k[static_cast<std::size_t>(r)];
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
        const auto& k = q.k[static_cast<std::size_t>(r)];
        auto& out = map.coefficients[static_cast<std::size_t>(r)];
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
        const Correspondence& c = pairs[static_cast<std::size_t>(i)];
        a.row(i) = basis(scaled(q, c.skin));
        b.row(i) << c.place.x, c.place.y, c.place.z;
    }
    a.bottomRows(10) = rows.left;
    b.bottomRows(10) = rows.right;
    // Rank-revealing: a sample of repeated points leaves directions open, which stay at zero.
    const Eigen::MatrixXd k = a.completeOrthogonalDecomposition().solve(b);
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 10; ++c) {
            q.k[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] = k(c, r);
        }
    }
    return q;
}

double proven_min_det(const RigidQuadratic& q, const Box3& box) {
    Registration r;
    r.quadratic = in_frames(q, {}, {});
    r.ct_box = box;
    return prove_no_fold(r).least_bound;
}

RansacResult ransac_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              const Rigid& rigid,
                              const Box3& box,
                              const RansacOptions& options,
                              const Progress& progress) {
    RansacResult result;
    result.map = RigidQuadratic::from_rigid(rigid);
    // N_v points of the skin, N_m of the mannequin.
    std::vector<Point3> inner;
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
        if (!skin.on_rim[i]) inner.push_back(skin.points[i]);
    }
    const std::vector<Point3> volume =
        every_so_many(inner, static_cast<std::size_t>(std::max(1, options.skin_points)));
    std::vector<Point3> places;
    for (std::size_t j = 0; j < target.points.size(); ++j) {
        if (!target.lifted[j]) places.push_back(target.points[j]);
    }
    if (volume.empty() || places.empty()) return result;
    const PointIndex index(places);
    Vector3 sum;
    for (Point3 p : places) sum = sum + (p - Point3{});
    const Point3 centroid = Point3{} + sum / static_cast<double>(places.size());
    double mean_distance = 0;
    for (Point3 p : places)
        mean_distance += distance(p, centroid) / static_cast<double>(places.size());
    result.consensus_mm = options.consensus_share * mean_distance;

    // Eqs. (7)-(8): the true entries of the N_v x N_m matrix, row by row.
    struct Entry {
        std::uint32_t volume, place;
    };
    std::vector<std::vector<Entry>> by_row(volume.size());
    parallel_for(volume.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
            const Point3 p = rigid * volume[v];
            double nearest2 = 0;
            index.nearest(p, &nearest2);
            const double limit2 = options.match_ratio * options.match_ratio * nearest2;
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

    // Eq. (9).
    const auto consensus = [&](const RigidQuadratic& q) {
        int near = 0;
        for (Point3 v : volume) {
            double d2 = 0;
            index.nearest(map_point(q, v), &d2);
            near += d2 < result.consensus_mm * result.consensus_mm;
        }
        return near / static_cast<double>(volume.size());
    };
    result.rigid_consensus = result.consensus = consensus(result.map);
    if (entries.empty() || options.trials <= 0) return result;

    struct Trial {
        RigidQuadratic map;
        double consensus = -1;
        bool folds = false;
    };
    std::vector<Trial> trials(static_cast<std::size_t>(options.trials));
    parallel_for(trials.size(), 2, [&](std::size_t begin, std::size_t end) {
        for (std::size_t t = begin; t < end; ++t) {
            std::uint64_t state = options.seed * 0x9E3779B97F4A7C15ull + t;
            const auto next = [&state] {  // splitmix64
                std::uint64_t z = state += 0x9E3779B97F4A7C15ull;
                z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
                z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
                return z ^ (z >> 31);
            };
            std::vector<Correspondence> sample;
            for (int n = 0; n < options.correspondences; ++n) {
                const Entry e = entries[next() % entries.size()];
                sample.push_back({volume[e.volume], places[e.place]});
            }
            trials[t].map = fit_correspondences(sample, rigid, options.constraint_mm);
            if (!(proven_min_det(trials[t].map, box) > kLeastDetJacobian)) {
                trials[t].folds = true;
                continue;
            }
            trials[t].consensus = consensus(trials[t].map);
        }
    });
    tell(progress, 0.8, "quadratic warp: trials done");
    for (std::size_t t = 0; t < trials.size(); ++t) {
        result.folding_trials += trials[t].folds;
        result.best_trial_consensus = std::max(result.best_trial_consensus, trials[t].consensus);
        if (trials[t].consensus > result.consensus) {
            result.consensus = trials[t].consensus;
            result.map = trials[t].map;
            result.best_trial = static_cast<int>(t);
        }
    }
    // Re-estimate from all closest pairs within T_c; keep the better.
    std::vector<Correspondence> pairs;
    for (Point3 v : volume) {
        double d2 = 0;
        const std::uint32_t m = index.nearest(map_point(result.map, v), &d2);
        if (d2 < result.consensus_mm * result.consensus_mm) pairs.push_back({v, places[m]});
    }
    if (pairs.size() >= 10) {
        const RigidQuadratic again = fit_correspondences(pairs, rigid, options.constraint_mm);
        const double c = consensus(again);
        if (c > result.consensus && proven_min_det(again, box) > kLeastDetJacobian) {
            result.map = again;
            result.consensus = c;
            result.re_estimated = true;
        }
    }
    return result;
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

RefineResult refine_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              std::span<const std::uint32_t> readings,
                              const RigidQuadratic& start,
                              const RefineOptions& options) {
    RefineResult result;
    result.map = start;
    RigidQuadratic& q = result.map;
    const std::vector<Point3> held = every_so_many(skin.points, 800);
    const ConstraintRows constraint =
        constraint_rows(q, held, options.constraint_mm, static_cast<double>(held.size()));
    const std::size_t stride = std::max<std::size_t>(
        1, skin.points.size() / static_cast<std::size_t>(std::max(1, options.skin_askers)));
    for (int n = 0; n < options.iterations; ++n) {
        const double t =
            options.iterations > 1 ? static_cast<double>(n) / (options.iterations - 1) : 1;
        const double loss =
            options.first_loss_mm * std::pow(options.last_loss_mm / options.first_loss_mm, t);
        MatchOptions gates;
        gates.farthest_mm =
            options.first_gate_mm + t * (options.last_gate_mm - options.first_gate_mm);
        gates.side_step_mm = 1.2 * target.spacing_mm;
        const MappedSkin mapped = map_skin(skin, q);
        const Matches matches = find_matches(skin, mapped.points, mapped.normals, mapped.index,
                                             target, readings, stride, gates);
        const std::size_t count = matches.from_target.size() + matches.from_skin.size();
        if (count < 30) break;
        const auto marks = static_cast<Eigen::Index>(options.landmarks.size());
        Eigen::MatrixXd a(static_cast<Eigen::Index>(count) + 3 * marks + 30, 30);
        Eigen::VectorXd b(a.rows());
        a.bottomRows(30).setZero();
        Eigen::Index row = 0;
        const auto add = [&](const std::vector<Match>& list) {
            const double share = 0.5 / static_cast<double>(std::max<std::size_t>(1, list.size()));
            for (const Match& m : list) {
                const double w = std::sqrt(2 * share / (1 + m.gap_mm * m.gap_mm / (loss * loss)));
                const Row10 basis_row = basis(scaled(q, skin.points[m.skin]));
                for (int d = 0; d < 3; ++d)
                    a.block<1, 10>(row, 10 * d) = w * m.normal[d] * basis_row;
                b[row++] = w * dot(m.normal, m.place - Point3{});
            }
        };
        add(matches.from_target);
        add(matches.from_skin);
        for (const Correspondence& c : options.landmarks) {
            const Vector3 r = map_point(q, c.skin) - c.place;
            const double w = std::sqrt(2 * options.landmark_weight / (1 + dot(r, r) / (30 * 30)));
            const Row10 basis_row = basis(scaled(q, c.skin));
            for (int d = 0; d < 3; ++d, ++row) {
                a.row(row).setZero();
                a.block<1, 10>(row, 10 * d) = w * basis_row;
                b[row] = w * c.place[d];
            }
        }
        for (int d = 0; d < 3; ++d) {
            a.block<10, 10>(row + 10 * d, 10 * d) = constraint.left;
            b.segment<10>(row + 10 * d) = constraint.right.col(d);
        }
        Eigen::HouseholderQR<Eigen::MatrixXd> qr(a);
        if (n + 1 == options.iterations) {
            const Eigen::MatrixXd r = qr.matrixQR().topRows(30).triangularView<Eigen::Upper>();
            const Eigen::JacobiSVD<Eigen::MatrixXd> svd(r);
            result.condition = svd.singularValues()[0] / svd.singularValues()[29];
        }
        const Eigen::VectorXd k = qr.solve(b);
        if (!k.allFinite()) break;
        for (int d = 0; d < 3; ++d) {
            for (int c = 0; c < 10; ++c) {
                q.k[static_cast<std::size_t>(d)][static_cast<std::size_t>(c)] = k[10 * d + c];
            }
        }
    }
    for (int d = 0; d < 3; ++d) {
        Eigen::Matrix<double, 10, 1> k;
        for (int c = 0; c < 10; ++c)
            k[c] = q.k[static_cast<std::size_t>(d)][static_cast<std::size_t>(c)];
        result.constraint_cost += (constraint.left * k - constraint.right.col(d)).squaredNorm();
    }
    return result;
}

}  // namespace sonocase::pipeline
