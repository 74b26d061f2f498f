// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/refine_point.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "pipeline/calibration/touched_points.h"
#include "support/calibration_motion.h"
#include "support/hard_case.h"
#include "support/read_recording.h"

namespace sonocase::pipeline {
namespace {

using testing::HardCase;

using testing::pivot_recording;
using testing::PivotMotion;
using testing::Random;

TEST(RefinePoint, ExactReadingsStayExact) {
    Random random(1);
    PivotMotion motion;
    const std::vector<Pose> poses = pivot_recording(motion, random);
    const RefinePointResult out = refine_point(poses, fit_point(poses));
    EXPECT_TRUE(out.converged);
    EXPECT_LT(norm(out.tip_mm - motion.tip_mm), 1e-6);
}

TEST(RefinePoint, UndoesTheBiasThatNoisyRotationsGiveASmallTilt) {
    HardCase ratio("tip refined, over the linear answer's error", HardCase::at_most, 0.7, "");
    // 6 degrees of tilt and 0.6 degrees of rotation noise, many poses: the linear answer is biased.
    Random random(2);
    double linear = 0, refined = 0;
    for (int draw = 0; draw < 12; ++draw) {
        PivotMotion motion;
        motion.poses = 400;
        motion.tilt_rad = motion.twist_rad = 0.1;
        motion.gaussian_mm = 0.1;
        std::vector<Pose> poses = pivot_recording(motion, random);
        for (Pose& p : poses) {
            Matrix3& r = p.tracker_from_tool.rotation;
            const Vector3 w{0.01 * random.gaussian(), 0.01 * random.gaussian(),
                            0.01 * random.gaussian()};
            r = nearest_rotation(r * rotation_about(normalized(w), norm(w)));
        }
        const PointFit start = fit_point(poses, {.rests = RestSearch::one});
        ASSERT_TRUE(start.determined);
        const RefinePointResult out =
            refine_point(poses, start, {.position_sigma_mm = 0.1, .rotation_sigma_rad = 0.01});
        linear += norm(start.tip_mm - motion.tip_mm) / 12;
        refined += norm(out.tip_mm - motion.tip_mm) / 12;
    }
    std::printf("mean tip error: linear %.2f mm, refined %.2f mm\n", linear, refined);
    ratio.see(refined / linear);
}

TEST(RefinePoint, StaysNearThePublishedAnswer) {
    const std::vector<Pose> poses = testing::read_recording("pivot_optical_yaniv/poses.csv");
    if (poses.empty()) GTEST_SKIP() << "shared/data/tracking is absent";
    const RefinePointResult out = refine_point(poses, fit_point(poses));
    EXPECT_TRUE(out.converged);
    EXPECT_LT(norm(out.tip_mm - Vector3{-17.78, 1.111, -156.865}), 0.5);
    std::printf("refined tip (%.3f, %.3f, %.3f), sigma (%.3f, %.3f, %.3f), %.0f ms\n", out.tip_mm.x,
                out.tip_mm.y, out.tip_mm.z, out.sigma_mm.x, out.sigma_mm.y, out.sigma_mm.z,
                1e3 * out.seconds);
}

TEST(TouchedPoints, TablesWithAndWithoutNames) {
    const auto named = parse_named_points("name,x,y,z\nnavel,1,2,3\nhip,4,5,6\n", "a");
    ASSERT_TRUE(named);
    EXPECT_EQ(named->names[1], "hip");
    EXPECT_EQ(named->points[1], (Point3{4, 5, 6}));
    const auto plain = parse_named_points("1,2,3\n4,5,6\n", "a");
    ASSERT_TRUE(plain);
    EXPECT_TRUE(plain->names.empty());
    EXPECT_FALSE(parse_named_points("", "a"));
    EXPECT_FALSE(parse_named_points("name,x,y,z\nnavel,1,two,3\n", "a"));
    EXPECT_FALSE(parse_named_points("1,2\n", "a"));
    const auto pairs = pair_points(*named, *parse_named_points("hip,0,0,1\nnavel,0,0,2\n", "b"));
    ASSERT_TRUE(pairs);
    EXPECT_EQ(pairs->first.points[0], (Point3{4, 5, 6}));
    EXPECT_FALSE(pair_points(*named, *parse_named_points("knee,0,0,1\n", "b")));
    EXPECT_FALSE(pair_points(*plain, *parse_named_points("0,0,1\n", "b")));
    EXPECT_TRUE(parse_signal("time_s,value\n0,1\n1,2\n", "c"));
    EXPECT_FALSE(parse_signal("0,1\n1\n", "c"));
}

}  // namespace
}  // namespace sonocase::pipeline
