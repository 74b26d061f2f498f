// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/body_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace sonocase {
namespace {

constexpr int kUnknowns = 7;    // rotation, translation, outward move of the edges
constexpr double kHuber = 2.5;  // standard deviations
using Vector7 = Eigen::Matrix<double, kUnknowns, 1>;
using Matrix7 = Eigen::Matrix<double, kUnknowns, kUnknowns>;

struct Sums {
    Matrix7 normal = Matrix7::Zero();
    Vector7 right = Vector7::Zero();
    double cost = 0;  // Huber's
    double square = 0, square_px = 0;
    int behind = 0;  // points that are not in front of the camera
};

// Residuals of a pose, with their normal equations.
Sums sums_of(const CameraModel& camera,
             std::span<const TagSight> tags,
             const Rigid& pose,
             double bleed) {
    Sums s;
    for (const TagSight& sight : tags) {
        const std::array<Point3, 4> corners = tag_corners(*sight.tag);
        Eigen::Matrix<double, 8, 1> off_px;
        Eigen::Matrix<double, 8, kUnknowns> rows;
        bool behind = false;
        Pixel at[4];
        for (int k = 0; k < 4; ++k) {
            const Vector3 arm = pose.rotation * (corners[k] - Point3{});
            double j[6];
            if (!project(camera, arm + pose.translation, at[k], j)) {
                behind = true;
                break;
            }
            for (int axis = 0; axis < 2; ++axis) {
                const Vector3 by_place{j[3 * axis], j[3 * axis + 1], j[3 * axis + 2]};
                const Vector3 by_turn = cross(arm, by_place);
                rows.row(2 * k + axis) << by_turn.x, by_turn.y, by_turn.z, by_place.x, by_place.y,
                    by_place.z, 0;
            }
        }
        if (behind) {
            ++s.behind;
            s.cost += 1e6;
            continue;
        }
        for (int k = 0; k < 4; ++k) {
            // Outwards along both edges that meet here.
            const Pixel a = at[(k + 3) % 4], b = at[k], c = at[(k + 1) % 4];
            const auto length = [](double x, double y) { return std::sqrt(x * x + y * y); };
            const double in = length(b.x - a.x, b.y - a.y), on = length(c.x - b.x, c.y - b.y);
            const double ox = (b.x - a.x) / in - (c.x - b.x) / on;
            const double oy = (b.y - a.y) / in - (c.y - b.y) / on;
            rows(2 * k, 6) = ox, rows(2 * k + 1, 6) = oy;
            off_px[2 * k] = b.x + bleed * ox - sight.seen->corners[k].x;
            off_px[2 * k + 1] = b.y + bleed * oy - sight.seen->corners[k].y;
            s.square_px += off_px[2 * k] * off_px[2 * k] + off_px[2 * k + 1] * off_px[2 * k + 1];
        }
        const Eigen::Map<const Eigen::Matrix<double, 8, 8, Eigen::RowMajor>> whitening(
            sight.seen->whitening.data());
        const auto upper = whitening.triangularView<Eigen::Upper>();
        Eigen::Matrix<double, 8, 1> residual = upper * off_px;
        Eigen::Matrix<double, 8, kUnknowns> white = upper * rows;
        for (int r = 0; r < 8; ++r) {
            const double size = std::abs(residual[r]);
            const double weight = size <= kHuber ? 1 : kHuber / size;
            s.cost += size <= kHuber ? size * size : kHuber * (2 * size - kHuber);
            s.square += weight * size * size;
            white.row(r) *= std::sqrt(weight);
            residual[r] *= std::sqrt(weight);
        }
        s.normal.noalias() += white.transpose() * white;
        s.right.noalias() -= white.transpose() * residual;
    }
    constexpr double kHeld = 1 / (kBleed * kBleed);
    s.normal(6, 6) += kHeld;
    s.right[6] -= bleed * kHeld;
    s.cost += bleed * bleed * kHeld;
    return s;
}

Rigid moved(const Rigid& pose, const Vector7& step) {
    const Vector3 turn{step[0], step[1], step[2]};
    const double angle = norm(turn);
    Rigid out = pose;
    if (angle > 1e-15) out.rotation = rotation_about(turn / angle, angle) * pose.rotation;
    out.translation = pose.translation + Vector3{step[3], step[4], step[5]};
    return out;
}

double largest_eigenvalue(const std::array<double, 9>& symmetric) {
    const Eigen::Map<const Eigen::Matrix3d> m(symmetric.data());
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m, Eigen::EigenvaluesOnly)
        .eigenvalues()[2];
}

// The pose of one square from its four corners, by the homography; nothing where they are no quad.
std::optional<Rigid> pose_of_square(const CameraModel& camera,
                                    const SeenTag& seen,
                                    double edge_mm) {
    // Solves h for u (h31 x + h32 y + 1) = h11 x + h12 y + h13, and the same of v. x and y are -1
    // and 1.
    constexpr double kX[4] = {-1, 1, 1, -1}, kY[4] = {-1, -1, 1, 1};
    Eigen::Matrix<double, 8, 8> m;
    Eigen::Matrix<double, 8, 1> seen_at;
    for (int k = 0; k < 4; ++k) {
        const Vector3 d = direction_at(camera, seen.corners[k]);
        const double x = kX[k], y = kY[k];
        m.row(2 * k) << x, y, 1, 0, 0, 0, -d.x * x, -d.x * y;
        m.row(2 * k + 1) << 0, 0, 0, x, y, 1, -d.y * x, -d.y * y;
        seen_at[2 * k] = d.x, seen_at[2 * k + 1] = d.y;
    }
    const Eigen::Matrix<double, 8, 1> h = m.partialPivLu().solve(seen_at);
    if (!h.allFinite()) return {};
    const Vector3 a{h[0], h[3], h[6]}, b{h[1], h[4], h[7]}, c{h[2], h[5], 1};
    const double scale = 2 / (norm(a) + norm(b));
    if (!(scale > 0) || !std::isfinite(scale)) return {};
    const Vector3 x = normalized(a), y0 = b - dot(b, x) * x;
    if (!(norm(y0) > 1e-9)) return {};
    // Both axes are turned by half of what they lack to a right angle.
    const Vector3 y = normalized(b);
    const Vector3 sum = normalized(x + y), difference = normalized(x - y);
    const Vector3 ux = normalized(sum + difference), uy = normalized(sum - difference);
    return Rigid{Matrix3::from_columns(ux, uy, cross(ux, uy)), 0.5 * edge_mm * scale * c};
}

// The pose whose surface leans the other way about the line of sight.
Rigid leaning_other_way(const Rigid& camera_from_tag) {
    const Vector3 towards = normalized(-camera_from_tag.translation);
    const Vector3 out = camera_from_tag.rotation.column(2);
    const Vector3 axis = cross(out, towards);
    const double sine = norm(axis);
    if (!(sine > 1e-6)) return camera_from_tag;
    const double lean = std::atan2(sine, dot(out, towards));
    return {rotation_about(axis / sine, 2 * lean) * camera_from_tag.rotation,
            camera_from_tag.translation};
}

bool same_pose(const Rigid& a, const Rigid& b) {
    constexpr double kAngle = 0.02, kPart = 0.01;  // rad; of the distance
    return rotation_angle(transpose(a.rotation) * b.rotation) < kAngle &&
           norm(a.translation - b.translation) < kPart * norm(a.translation);
}

}  // namespace

std::optional<BodyPose> fit_body_pose(const CameraModel& camera,
                                      std::span<const TagSight> tags,
                                      const Rigid& start,
                                      int max_iterations) {
    if (tags.empty()) return {};
    Rigid pose = start;
    double bleed = 0, damping = 1e-4;
    Sums now = sums_of(camera, tags, pose, bleed);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
        Matrix7 damped = now.normal;
        damped.diagonal() *= 1 + damping;
        const Eigen::LLT<Matrix7> factor(damped);
        if (factor.info() != Eigen::Success) return {};
        const Vector7 step = factor.solve(now.right);
        const Rigid next = moved(pose, step);
        const Sums then = sums_of(camera, tags, next, bleed + step[6]);
        if (!(then.cost <= now.cost * (1 + 1e-12))) {
            damping = std::max(1e-3, damping * 10);
            if (damping > 1e6) break;
            continue;
        }
        const double gain = now.cost - then.cost;
        pose = next;
        bleed += step[6];
        now = then;
        damping *= 0.1;
        if (gain < 1e-6 * (1 + now.cost)) break;
    }
    const Eigen::LLT<Matrix7> factor(now.normal);
    if (now.behind > 0 || !is_finite(pose) || factor.info() != Eigen::Success) return {};
    BodyPose out;
    out.camera_from_body = {nearest_rotation(pose.rotation), pose.translation};
    out.tags = static_cast<int>(tags.size());
    const double count = 8.0 * static_cast<double>(tags.size());
    out.residual = std::sqrt(now.square / (count - 6));
    out.residual_px = std::sqrt(now.square_px / count);
    const double widen = std::max(1.0, out.residual * out.residual);
    const Matrix7 inverse = factor.solve(Matrix7::Identity());
    Eigen::Map<Eigen::Matrix<double, 6, 6>>(out.covariance.data()) =
        widen * inverse.topLeftCorner<6, 6>();
    out.margin = now.cost;  // until find_body_pose() compares
    return out;
}

std::optional<BodyPose> find_body_pose(const CameraModel& camera,
                                       std::span<const TagSight> tags,
                                       const Rigid* predicted) {
    if (tags.empty()) return {};
    // Starts: both poses of the two tags that are seen largest, and the prediction.
    std::array<Rigid, 5> starts;
    std::size_t start_count = 0;
    const auto add = [&](const Rigid& pose) { starts[start_count++] = pose; };
    const auto area = [](const SeenTag& s) {
        double twice = 0;
        for (int k = 0; k < 4; ++k) {
            const Pixel a = s.corners[k], b = s.corners[(k + 1) % 4];
            twice += a.x * b.y - a.y * b.x;
        }
        return std::abs(twice);
    };
    const TagSight* first = nullptr;
    const TagSight* second = nullptr;
    for (const TagSight& sight : tags) {
        if (!first || area(*sight.seen) > area(*first->seen)) {
            second = first;
            first = &sight;
        } else if (!second || area(*sight.seen) > area(*second->seen)) {
            second = &sight;
        }
    }
    for (const TagSight* sight : {first, second}) {
        if (!sight) continue;
        const std::optional<Rigid> pose = pose_of_square(camera, *sight->seen, sight->tag->edge_mm);
        if (!pose) continue;
        const Rigid tag_from_body = inverse(sight->tag->body_from_tag);
        add(*pose * tag_from_body);
        add(leaning_other_way(*pose) * tag_from_body);
    }
    if (predicted) add(*predicted);
    std::optional<BodyPose> best, other;
    for (std::size_t k = 0; k < start_count; ++k) {
        std::optional<BodyPose> fit = fit_body_pose(camera, tags, starts[k]);
        if (!fit) continue;
        if (best && same_pose(fit->camera_from_body, best->camera_from_body)) {
            if (fit->margin < best->margin) best = fit;
        } else if (!best || fit->margin < best->margin) {
            other = best;
            best = fit;
        } else if (!other || fit->margin < other->margin) {
            other = fit;
        }
    }
    if (!best) return {};
    const double cost = best->margin;
    best->margin = std::numeric_limits<double>::infinity();
    if (other) {
        // In the scale of the residuals, where those are larger than the corners' covariance says.
        best->margin = (other->margin - cost) / std::max(1.0, best->residual * best->residual);
        best->second = other->camera_from_body;
    }
    return best;
}

std::array<double, 9> point_covariance(const BodyPose& pose, Point3 point_body) {
    // d point / d (turn, place) = [ -[arm] x, 1 ]
    const Vector3 a = pose.camera_from_body.rotation * (point_body - Point3{});
    const double j[3][6] = {
        {0, a.z, -a.y, 1, 0, 0}, {-a.z, 0, a.x, 0, 1, 0}, {a.y, -a.x, 0, 0, 0, 1}};
    std::array<double, 9> out{};
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
            for (int k = 0; k < 6; ++k)
                for (int l = 0; l < 6; ++l)
                    out[3 * r + c] += j[r][k] * pose.covariance[6 * k + l] * j[c][l];
    return out;
}

double worst_sigma_mm(const BodyPose& pose, Point3 point_body) {
    return std::sqrt(std::max(0.0, largest_eigenvalue(point_covariance(pose, point_body))));
}

std::array<double, 9> turn_covariance(const BodyPose& pose) {
    std::array<double, 9> turn{};
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) turn[3 * r + c] = pose.covariance[6 * r + c];
    return turn;
}

double worst_sigma_rad(const BodyPose& pose) {
    return std::sqrt(std::max(0.0, largest_eigenvalue(turn_covariance(pose))));
}

}  // namespace sonocase
