// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/warp/quadratic_warp.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/fold_proof.h"
#include "pipeline/registration/warp/quadratic_rows.h"

namespace sonocase::pipeline {

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
    // Rank-revealing: directions that repeated points leave undetermined stay at zero.
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

}  // namespace sonocase::pipeline
