// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt_steps.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(TargetsReached, TheTipMarksATargetWithinItsRadiusAndTheMarkStays) {
    Exercise exercise;
    exercise.targets.resize(2);
    exercise.targets[0].hit_radius_mm = 3;
    exercise.targets[1].hit_radius_mm = 3;
    const std::vector<Point3> centres{{0, 0, 50}, {20, 0, 50}};
    std::vector<bool> reached(2, false);
    FrameRecord record;
    record.needle.mannequin_from_drawn.translation = {0, 0, 52};
    mark_targets_reached(exercise, record, centres, reached);
    EXPECT_FALSE(reached[0]);  // no needle
    record.tools.has_needle = true;
    mark_targets_reached(exercise, record, centres, reached);
    EXPECT_TRUE(reached[0]);
    EXPECT_FALSE(reached[1]);
    record.needle.mannequin_from_drawn.translation = {0, 0, 0};
    mark_targets_reached(exercise, record, centres, reached);
    EXPECT_TRUE(reached[0]);
}

TEST(Cine, StepsThroughTheKeptFramesAndPlaysInARing) {
    ScanState scan;
    step_cine(scan, 1, 3);
    EXPECT_TRUE(scan.controls.frozen);
    EXPECT_EQ(scan.controls.cine_back, 1);
    step_cine(scan, 5, 3);
    EXPECT_EQ(scan.controls.cine_back, 2);
    scan.cine.playing = true;
    for (int expected : {1, 0, 2}) {
        scan.cine.last_step_s = 0;
        advance_cine(scan, 3, 1);
        EXPECT_EQ(scan.controls.cine_back, expected);
    }
    advance_cine(scan, 3, 1 + 0.5 / kCineRate);  // before the next frame's time
    EXPECT_EQ(scan.controls.cine_back, 2);
    set_frozen(scan, false);
    EXPECT_EQ(scan.controls.cine_back, 0);
    EXPECT_FALSE(scan.cine.playing);
}

}  // namespace
}  // namespace sonocase::runtime
