// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/pose_predictor.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace sonocase {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

Vector3 rotation_vector(const Matrix3& r) {
    const double angle = rotation_angle(r);
    if (!(angle > 1e-12)) return {};
    const Quaternion q = quaternion_from_rotation(r);
    const Vector3 axis{q.x, q.y, q.z};
    const double length = norm(axis);
    return length > 0 ? (angle / length) * axis : Vector3{};
}
Matrix3 turned_by(Vector3 v) {
    const double angle = norm(v);
    return angle > 1e-15 ? rotation_about(v / angle, angle) : Matrix3{};
}
Vector3 shortened(Vector3 v, double longest) {
    const double length = norm(v);
    return length > longest ? (longest / length) * v : v;
}

// Three coordinates and their velocities; the coordinates themselves are the caller's, who adds
// what update() says.
struct Motion {
    Vector3 velocity;
    Vector3 slowing;  // acceleration against the velocity, from the last two poses
    Matrix6 covariance = Matrix6::Zero();

    void start(const Eigen::Matrix3d& measured, double speed_sigma) {
        velocity = slowing = {};
        covariance.setZero();
        covariance.topLeftCorner<3, 3>() = measured;
        covariance.bottomRightCorner<3, 3>().diagonal().setConstant(speed_sigma * speed_sigma);
    }

    Matrix6 predicted(double dt, double acceleration) const {
        Matrix6 step = Matrix6::Identity();
        step.topRightCorner<3, 3>().diagonal().setConstant(dt);
        Matrix6 p = step * covariance * step.transpose();
        const double q = acceleration * acceleration * dt * dt;
        p.topLeftCorner<3, 3>().diagonal().array() += 0.25 * q * dt * dt;
        p.topRightCorner<3, 3>().diagonal().array() += 0.5 * q * dt;
        p.bottomLeftCorner<3, 3>().diagonal().array() += 0.5 * q * dt;
        p.bottomRightCorner<3, 3>().diagonal().array() += q;
        return p;
    }

    // The way in the next seconds. A motion that slows down goes on slowing down, until it rests;
    // one that gains speed is not known to go on so. Not for turns, whose noise is larger than what
    // their slowing tells.
    Vector3 ahead(double seconds) const {
        const double speed = norm(velocity), rate = norm(slowing);
        const double t = rate * seconds > speed ? speed / rate : seconds;
        return t * velocity + (0.5 * t * t) * slowing;
    }

    // off: measured less predicted coordinates. Returns what is to be added to the predicted ones.
    Vector3 update(Vector3 off, const Eigen::Matrix3d& measured, double dt, double acceleration) {
        const Eigen::Vector3d innovation{off.x, off.y, off.z};
        Matrix6 p = predicted(dt, acceleration);
        Eigen::Matrix3d spread = p.topLeftCorner<3, 3>() + measured;
        // A hand that sets off or stops suddenly: more acceleration than was expected. Its standard
        // deviation is not all that would explain the surprise, a part of which is noise.
        constexpr double kSurprise = 16;  // 99.9 % of a normal distribution in three dimensions
        constexpr double kPart = 0.3;
        const double chi = innovation.dot(spread.llt().solve(innovation));
        if (chi > kSurprise) {
            const double needed = kPart * innovation.norm() / (dt * dt);
            p = predicted(dt, std::max(acceleration, needed));
            spread = p.topLeftCorner<3, 3>() + measured;
        }
        const Eigen::Matrix<double, 6, 3> gain =
            spread.llt().solve(p.leftCols<3>().transpose()).transpose();
        const Vector6 change = gain * innovation;
        covariance = p - gain * p.topRows<3>();
        covariance = 0.5 * (covariance + covariance.transpose()).eval();
        const Vector3 change_of_velocity{change[3], change[4], change[5]};
        const double along = dot(change_of_velocity, velocity), square = dot(velocity, velocity);
        slowing = along < 0 && square > 0 ? (along / (square * dt)) * velocity : Vector3{};
        velocity = velocity + change_of_velocity;
        if (!(dot(slowing, velocity) < 0)) slowing = {};  // it turned back
        return {change[0], change[1], change[2]};
    }
};

Eigen::Matrix3d matrix_of(const std::array<double, 9>& m) {
    return Eigen::Map<const Eigen::Matrix3d>(m.data());
}

}  // namespace

struct PosePredictor::State {
    Point3 tool_body;
    PredictorOptions options;
    bool running = false;
    double time_s = 0;
    Point3 place;  // of the tool, in the world
    Matrix3 rotation;
    Motion way, turn;
};

PosePredictor::PosePredictor(Point3 tool_body, const PredictorOptions& options)
    : state_(std::make_unique<State>()) {
    state_->tool_body = tool_body;
    state_->options = options;
}
PosePredictor::PosePredictor(PosePredictor&&) noexcept = default;
PosePredictor& PosePredictor::operator=(PosePredictor&&) noexcept = default;
PosePredictor::~PosePredictor() = default;

Rigid PosePredictor::follow(const MarkerReading& reading, double time_s, double at_s) {
    State& s = *state_;
    if (reading.status == MarkerStatus::lost || reading.two_poses) {
        s.running = false;
        return reading.world_from_body;
    }
    const PredictorOptions& o = s.options;
    const Eigen::Matrix3d way_spread = matrix_of(reading.point_covariance);
    const Eigen::Matrix3d turn_spread = matrix_of(reading.turn_covariance);
    const Point3 place = reading.world_from_body * s.tool_body;
    const double dt = time_s - s.time_s;
    if (!s.running || !(dt > 0) || dt > o.max_gap_s) {
        s.running = true;
        s.place = place;
        s.rotation = reading.world_from_body.rotation;
        // A hand may be moving already.
        constexpr double kSpeedMm = 50, kSpeedRad = 0.5;
        s.way.start(way_spread, kSpeedMm);
        s.turn.start(turn_spread, kSpeedRad);
    } else {
        const Point3 place_then = s.place + dt * s.way.velocity;
        s.place = place_then + s.way.update(place - place_then, way_spread, dt,
                                            o.rest_mm_s2 + o.by_speed_per_s * norm(s.way.velocity));
        const Matrix3 then = turned_by(dt * s.turn.velocity) * s.rotation;
        const Vector3 off = rotation_vector(reading.world_from_body.rotation * transpose(then));
        s.rotation =
            turned_by(s.turn.update(off, turn_spread, dt,
                                    o.rest_rad_s2 + o.by_speed_per_s * norm(s.turn.velocity))) *
            then;
    }
    s.time_s = time_s;
    const double ahead_s = std::max(0.0, at_s - time_s);
    Rigid out;
    out.rotation =
        nearest_rotation(turned_by(shortened(ahead_s * s.turn.velocity, o.max_rad)) * s.rotation);
    const Point3 tool = s.place + shortened(s.way.ahead(ahead_s), o.max_mm);
    out.translation = tool - out.rotation * (s.tool_body - Point3{}) - Point3{};
    return out;
}

}  // namespace sonocase
