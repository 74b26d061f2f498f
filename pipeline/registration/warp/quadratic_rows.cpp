// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/warp/quadratic_rows.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

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
        const auto& c = k[static_cast<std::size_t>(r)];
        const double slopes[3] = {c[1] + 2 * c[4] * w.x + c[7] * w.y + c[8] * w.z,
                                  c[2] + 2 * c[5] * w.y + c[7] * w.x + c[9] * w.z,
                                  c[3] + 2 * c[6] * w.z + c[8] * w.x + c[9] * w.y};
        column[r] = slopes[axis];
    }
    return column;
}

}  // namespace

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

}  // namespace sonocase::pipeline
