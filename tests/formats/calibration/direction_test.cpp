// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/direction.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "formats/calibration/pose_screen.h"
#include "support/hard_case.h"
#include "support/random.h"
#include "support/read_recording.h"

namespace sonocase {
namespace {

using testing::HardCase;

using testing::Random;
using testing::read_recording;

double angle(Vector3 a, Vector3 b) {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

std::vector<Pose> sweep(Vector3 along_sensor,
                        double noise_mm,
                        Random& random,
                        double length_mm = 100) {
    std::vector<Pose> poses;
    const Rigid start = random.rigid(500);
    const Vector3 way = start.rotation * along_sensor;
    for (int i = 0; i < 100; ++i) {
        Pose p;
        p.ok = true;
        p.frame = i;
        p.timestamp_s = i / 60.0;
        p.tracker_from_tool = start;
        p.tracker_from_tool.translation = start.translation + length_mm * i / 99.0 * way;
        for (int c = 0; c < 3; ++c)
            p.tracker_from_tool.translation[c] += noise_mm * random.gaussian();
        poses.push_back(p);
    }
    return poses;
}

TEST(Direction, KnownDirectionComesBackWithItsSign) {
    Random random(1);
    for (int draw = 0; draw < 50; ++draw) {
        const Vector3 truth = random.direction();
        EXPECT_LT(angle(fit_direction(sweep(truth, 0, random)).direction, truth), 1e-12);
        EXPECT_LT(angle(fit_direction_paper(sweep(truth, 0, random)), truth), 1e-10);
    }
}

TEST(Direction, SigmaCoversTheTruth) {
    Random random(2);
    int inside = 0;
    for (int draw = 0; draw < 600; ++draw) {
        const Vector3 truth = random.direction();
        const DirectionFit fit = fit_direction(sweep(truth, 0.5, random));
        ASSERT_TRUE(fit.determined);
        // One sigma each way: the error in one fixed transverse direction.
        const Vector3 side = any_perpendicular(truth);
        inside += std::abs(dot(fit.direction, side)) <= fit.sigma_rad;
    }
    EXPECT_NEAR(inside / 600.0, 0.683, 0.06);
}

TEST(Direction, LineBeatsThePaperPairsOnNoisyReadings) {
    Random random(3);
    double line = 0, pairs = 0;
    for (int draw = 0; draw < 100; ++draw) {
        const Vector3 truth = random.direction();
        const std::vector<Pose> poses = sweep(truth, 0.5, random);
        line += angle(fit_direction(poses).direction, truth);
        pairs += angle(fit_direction_paper(poses, 1), truth);
    }
    std::printf("mean error: line %.3f degrees, pairs %.3f degrees\n", line / 100 / kRadPerDeg,
                pairs / 100 / kRadPerDeg);
    EXPECT_LT(line, 0.5 * pairs);
}

TEST(Direction, StrayPosesAreLeftOut) {
    Random random(4);
    const Vector3 truth = random.direction();
    std::vector<Pose> poses = sweep(truth, 0.2, random);
    for (Pose& p : poses) {
        if (random.uniform(0, 1) < 0.3) {
            const Point3 at = random.point(300);
            p.tracker_from_tool.translation =
                p.tracker_from_tool.translation + Vector3{at.x, at.y, at.z};
        }
    }
    const DirectionFit fit = fit_direction(poses);
    EXPECT_LT(angle(fit.direction, truth), 0.3 * kRadPerDeg);
    EXPECT_LT(fit.inliers, 85);
}

// Two strokes there and two back: pairs of poses half a recording apart lie at one place.
TEST(Direction, BackAndForthHasTheSignOfItsFirstStroke) {
    Random random(6);
    HardCase off("direction of a sweep there and back twice, noise of 0.5 mm, off",
                 HardCase::at_most, 0.6, "degrees");
    for (int draw = 0; draw < 50; ++draw) {
        const Vector3 truth = random.direction();
        std::vector<Pose> poses = sweep(truth, 0.5, random);
        const std::vector<Pose> straight = poses;
        for (std::size_t i = 0; i < poses.size(); ++i) {
            const std::size_t at = 4 * i % 200;
            poses[i].tracker_from_tool = straight[at < 100 ? at : 199 - at].tracker_from_tool;
        }
        const DirectionFit fit = fit_direction(poses);
        EXPECT_TRUE(fit.back_and_forth);
        EXPECT_FALSE(fit.warnings.empty());
        off.see(angle(fit.direction, truth) / kRadPerDeg);
    }
}

TEST(Direction, StillShortAndCurvedSweepsSaySo) {
    Random random(5);
    EXPECT_FALSE(fit_direction(sweep({1, 0, 0}, 0, random, 0)).determined);
    EXPECT_NE(fit_direction(sweep({1, 0, 0}, 0, random, 0)).problem.find("moved only"),
              std::string::npos);
    EXPECT_NE(fit_direction(sweep({1, 0, 0}, 5, random, 2)).problem.find("not a straight line"),
              std::string::npos);
    EXPECT_NE(fit_direction({}).problem.find("0 usable"), std::string::npos);
    const DirectionFit brief = fit_direction(sweep({1, 0, 0}, 0.1, random, 12));
    EXPECT_TRUE(brief.determined);
    EXPECT_TRUE(std::any_of(brief.warnings.begin(), brief.warnings.end(), [](const std::string& w) {
        return w.find("only 12 mm long") != std::string::npos;
    }));
}

TEST(Direction, FrameIsOrthonormalAndKeepsTheBetterAxis) {
    HardCase skew("columns of the frame, off orthonormal", HardCase::at_most, 1e-14, "");
    DirectionFit depth, lateral;
    depth.determined = lateral.determined = true;
    depth.direction = {0, 0, 1};
    lateral.direction = normalized({1, 0, 0.1});
    depth.sigma_rad = 1e-9;
    lateral.sigma_rad = 0.01;
    const ProbeFrame frame = make_probe_frame(depth, lateral);
    EXPECT_TRUE(frame.determined);
    skew.see(orthonormality_error(frame.sensor_from_probe));
    EXPECT_NEAR(determinant(frame.sensor_from_probe), 1, 1e-14);
    EXPECT_LT(angle(frame.sensor_from_probe.column(2), {0, 0, 1}), 1e-12);
    EXPECT_LT(angle(frame.sensor_from_probe.column(0), {1, 0, 0}), 1e-12);
    EXPECT_NEAR(frame.raw_angle_rad, std::acos(0.1 / std::sqrt(1.01)), 1e-12);
    // Equal sigmas share the error.
    depth.sigma_rad = lateral.sigma_rad;
    const ProbeFrame shared = make_probe_frame(depth, lateral);
    const double error = 90 * kRadPerDeg - shared.raw_angle_rad;
    HardCase half("turn of either direction, off half of their error", HardCase::at_most, 1e-12,
                  "");
    half.see(std::abs(angle(shared.sensor_from_probe.column(2), depth.direction) - error / 2));
    half.see(std::abs(angle(shared.sensor_from_probe.column(0), lateral.direction) - error / 2));
    // the same sweep twice is not a frame.
    EXPECT_FALSE(make_probe_frame(depth, depth).determined);
}

TEST(Direction, WaterTankRecordingHasOneDirection) {
    const std::vector<Pose> poses =
        relative_poses(read_recording("probe_translation_watertank/reference_to_tracker.csv"),
                       read_recording("probe_translation_watertank/probe_to_tracker.csv"));
    if (poses.empty()) GTEST_SKIP() << "shared/data/tracking is absent";
    const DirectionFit all = fit_direction(poses);
    ASSERT_TRUE(all.determined);
    std::printf(
        "direction (%.3f %.3f %.3f) sigma %.2f degrees, %.0f mm, %.2f mm rms, turn %.2f degrees\n",
        all.direction.x, all.direction.y, all.direction.z, all.sigma_rad / kRadPerDeg,
        all.length_mm, all.rms_mm, all.turn_rad / kRadPerDeg);
    EXPECT_GT(all.length_mm, 20);
    // Two halves of the hand-made sweep agree within a few of their sigmas.
    const DirectionFit first = fit_direction(std::span(poses).first(poses.size() / 2));
    const DirectionFit second = fit_direction(std::span(poses).subspan(poses.size() / 2));
    const double apart = std::min(angle(first.direction, second.direction),
                                  angle(first.direction, -second.direction));
    EXPECT_LT(apart, 4 * std::hypot(first.sigma_rad, second.sigma_rad) * std::sqrt(2.0));
}

TEST(Direction, ScriptedSlideIsExact) {
    const std::vector<Pose> poses = read_recording("probe_and_needle_sliding/probe_to_tracker.csv");
    if (poses.empty()) GTEST_SKIP() << "shared/data/tracking is absent";
    const DirectionFit fit = fit_direction(poses);
    EXPECT_TRUE(fit.determined);
    EXPECT_NEAR(fit.length_mm, 38, 1);
    EXPECT_LT(fit.rms_mm, 0.01);
    EXPECT_LT(fit.turn_rad, 1e-6);
    EXPECT_FALSE(
        fit_direction(read_recording("probe_and_needle_sliding/needle_to_tracker.csv")).determined);
}

}  // namespace
}  // namespace sonocase
