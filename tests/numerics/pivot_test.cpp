// SPDX-License-Identifier: Apache-2.0

// Point, direction and needle calibration: limits, bounds from the condition number, invariances.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "formats/calibration/direction.h"
#include "formats/calibration/needle.h"
#include "formats/calibration/point.h"
#include "numerics/property.h"
#include "support/calibration_motion.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

using testing::pivot_recording;
using testing::PivotMotion;

// Exact data: the remaining error is the rounding of the stored poses, eps times the largest
// coordinate, times the amplification of the centred system, 1 / swing.
double rounding_bound(const PointFit& fit, double largest_mm) {
    return 100 * kEpsilon * largest_mm / fit.swing.z;
}

RC_GTEST_PROP(PivotNumerics, ExactDataErrorStaysWithinTheBoundOfTheCondition, ()) {
    testing::Random random = random_case();
    PivotMotion motion;
    motion.poses = static_cast<int>(random.uniform(8, 200));
    motion.tilt_rad = std::pow(10.0, random.uniform(-1.2, 0.3));  // 3.6 to 115 degrees
    motion.twist_rad = motion.tilt_rad;
    const double lever = std::pow(10.0, random.uniform(-1, 4)),
                 away = std::pow(10.0, random.uniform(0, 6));
    motion.tip_mm = lever * random.direction();
    const Vector3 p = away * random.direction();
    motion.pivot_mm = {p.x, p.y, p.z};
    const PointFit fit = fit_point(pivot_recording(motion, random));
    RC_ASSERT(fit.determined);
    RC_ASSERT(norm(fit.tip_mm - motion.tip_mm) <= rounding_bound(fit, lever + away));
    RC_ASSERT(distance(fit.pivot_mm, motion.pivot_mm) <= 3 * rounding_bound(fit, lever + away));
    RC_ASSERT(fit.inliers == fit.poses);
}

RC_GTEST_PROP(PivotNumerics,
              MovingTheTrackerTurningTheSensorAndChangingUnitsMoveTheAnswerAlong,
              ()) {
    testing::Random random = random_case();
    PivotMotion motion;
    motion.noise_mm = 0.4;
    const std::vector<Pose> poses = pivot_recording(motion, random);
    const PointFit fit = fit_point(poses);
    const Rigid move = random.rigid(3000);
    const Matrix3 turn = random.rotation();  // of the sensor in its housing
    std::vector<Pose> moved = poses, turned = poses, other = poses;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        moved[i].tracker_from_tool = move * poses[i].tracker_from_tool;
        turned[i].tracker_from_tool.rotation = poses[i].tracker_from_tool.rotation * turn;
        other[i].tracker_from_tool.translation = 3.0 * poses[i].tracker_from_tool.translation;
    }
    const double bound = 1e-8;  // 1e4 mm of coordinates and a condition number of about 10
    RC_ASSERT(norm(fit_point(moved).tip_mm - fit.tip_mm) < bound);
    RC_ASSERT(norm(turn * fit_point(turned).tip_mm - fit.tip_mm) < bound);
    RC_ASSERT(norm(fit_point(other).tip_mm - 3.0 * fit.tip_mm) < 3 * bound);
    RC_ASSERT(std::abs(fit_point(moved).condition - fit.condition) < 1e-9 * fit.condition);
    RC_ASSERT(norm(fit_point(moved).sigma_mm - fit.sigma_mm) < 1e-6 * norm(fit.sigma_mm));
}

RC_GTEST_PROP(PivotNumerics, OrderOfPosesDoesNotMatterToThePlainFit, ()) {
    testing::Random random = random_case();
    PivotMotion motion;
    motion.noise_mm = 0.4;
    std::vector<Pose> poses = pivot_recording(motion, random);
    const PointOptions plain{.reject_outliers = false};
    const PointFit fit = fit_point(poses, plain);
    std::reverse(poses.begin(), poses.end());
    RC_ASSERT(norm(fit_point(poses, plain).tip_mm - fit.tip_mm) < 1e-9);
}

TEST(PivotNumerics, ErrorFallsAsOneOverTheRootOfThePoses) {
    testing::Random random(3);
    double before = 0;
    for (int poses : {50, 200, 800}) {
        double square = 0;
        for (int draw = 0; draw < 60; ++draw) {
            PivotMotion motion;
            motion.poses = poses;
            motion.gaussian_mm = 0.5;
            const Vector3 e =
                fit_point(pivot_recording(motion, random), {.trials = 50}).tip_mm - motion.tip_mm;
            square += dot(e, e) / 60;
        }
        const double rms = std::sqrt(square);
        // Four times the poses, half the error; 180 components leave 8 % either way.
        if (before > 0) {
            EXPECT_NEAR(before / rms, 2, 0.5) << poses;
        }
        before = rms;
    }
}

TEST(PivotNumerics, HalfTurnsBetweenPosesAreNoSpecialCase) {
    HardCase tip("tip, half turns between poses", HardCase::at_most, 1e-11, "mm");
    testing::Random random(4);
    PivotMotion motion;
    std::vector<Pose> poses;
    for (const Vector3& axis : {Vector3{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}) {
        Pose pose;
        pose.ok = true;
        if (norm(axis) > 0)
            pose.tracker_from_tool.rotation = nearest_rotation(rotation_about(axis, kPi));
        const Point3 p = motion.pivot_mm - pose.tracker_from_tool.rotation * motion.tip_mm;
        pose.tracker_from_tool.translation = {p.x, p.y, p.z};
        poses.push_back(pose);
    }
    const PointFit fit = fit_point(poses);
    EXPECT_TRUE(fit.determined);
    // The mean rotation is zero: the best possible excitation, up to the square root of the
    // rounding.
    EXPECT_NEAR(fit.condition, 1, 1e-7);
    tip.see(norm(fit.tip_mm - motion.tip_mm));
}

TEST(PivotNumerics, GuardForTooLittleTurnFiresBetweenStillAndSlight) {
    testing::Random random(5);
    bool was = false;
    for (double degrees : {0.01, 0.1, 0.5, 1.0, 3.0}) {
        PivotMotion motion;
        motion.tilt_rad = motion.twist_rad = degrees * kRadPerDeg;
        const PointFit fit = fit_point(pivot_recording(motion, random));
        EXPECT_GE(fit.determined, was) << degrees;
        if (!fit.determined) {
            EXPECT_FALSE(fit.problem.empty());
            EXPECT_TRUE(std::isinf(fit.condition));
        } else {
            EXPECT_LT(norm(fit.tip_mm - motion.tip_mm), rounding_bound(fit, 1300));
        }
        was = fit.determined;
    }
    EXPECT_TRUE(was);
}

RC_GTEST_PROP(DirectionNumerics, LineKeepsItsDirectionUnderEveryMotionAndScale, ()) {
    testing::Random random = random_case();
    const Vector3 way = random.direction();
    const Rigid move = random.rigid(1e5);
    const double length = std::pow(10.0, random.uniform(0.5, 4));
    std::vector<Pose> poses;
    for (int i = 0; i < 40; ++i) {
        Pose pose;
        pose.ok = true;
        pose.tracker_from_tool.translation = length * i / 39 * way;
        pose.tracker_from_tool = move * pose.tracker_from_tool;
        poses.push_back(pose);
    }
    const DirectionFit fit = fit_direction(poses);
    RC_ASSERT(fit.determined);
    // Positions of 1e5 mm carry 1.5e-11 mm.
    RC_ASSERT(norm(fit.direction - way) < 1e-9 / length + 1e-14);
}

RC_GTEST_PROP(PrincipalAxisNumerics, NeedleOfExactPointsIsExactWhateverItsPlace, ()) {
    testing::Random random = random_case();
    const Vector3 way = random.direction();
    const Vector3 tip = 200.0 * random.direction();
    std::vector<std::vector<Pose>> recordings;
    std::vector<double> depths;
    for (int k = 0; k < 4; ++k) {
        depths.push_back(15.0 * k);
        PivotMotion motion;
        motion.poses = 12;
        motion.tip_mm = tip - depths.back() * way;
        recordings.push_back(pivot_recording(motion, random));
    }
    NeedleOptions options;
    options.depths_mm = depths;
    const NeedleFit fit = fit_needle(recordings, options);
    RC_ASSERT(fit.determined);
    RC_ASSERT(norm(fit.direction - way) < 1e-9);
    RC_ASSERT(norm(fit.tip_mm - tip) < 1e-7);
    // The paper's point is the point of the axis nearest to the sensor.
    RC_ASSERT(norm(cross(fit.paper_point_mm - tip, way)) < 1e-7);
    RC_ASSERT(std::abs(dot(fit.paper_point_mm, way)) < 1e-7);
}

}  // namespace
}  // namespace sonocase::numerics
