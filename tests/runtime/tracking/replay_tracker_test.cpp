#include "runtime/tracking/replay_tracker.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

Recording recording(int rows, double period_s) {
    Recording made;
    made.name = "made";
    for (int i = 0; i < rows; ++i) {
        Pose pose;
        pose.frame = i;
        pose.timestamp_s = 167.178 + i * period_s;
        pose.ok = i != 3;
        pose.tracker_from_tool.translation = {double(i), 0, 0};
        made.probe.push_back(pose);
    }
    return made;
}

TEST(ReplayTracker, StepsThroughEveryRowAtItsRecordedTime) {
    ReplayTracker replay(recording(50, 1 / 30.0), true);
    ASSERT_EQ(replay.recorded_readings(), 50);
    TrackerReading reading;
    for (int i = 0; i < 50; ++i) {
        ASSERT_TRUE(replay.poll(replay.recorded_time_s(i), reading)) << i;
        EXPECT_EQ(reading.sensors[kProbeSensor].world_from_sensor.translation.x, i);
        EXPECT_EQ(reading.sensors[kProbeSensor].state,
                  i == 3 ? SensorState::lost : SensorState::ok);
    }
    EXPECT_EQ(replay.health().bad_frames, 1u);
}

TEST(ReplayTracker, HasNothingNewBetweenTwoRows) {
    ReplayTracker replay(recording(5, 0.1), true);
    TrackerReading reading;
    EXPECT_TRUE(replay.poll(7.0, reading));
    EXPECT_FALSE(replay.poll(7.05, reading));
    EXPECT_TRUE(replay.poll(7.11, reading));
    EXPECT_EQ(reading.sequence, 2u);
}

TEST(ReplayTracker, PairsTheNeedleByTime) {
    Recording made = recording(10, 0.1);
    for (int i = 0; i < 4; ++i) {
        Pose pose;
        pose.ok = true;
        pose.timestamp_s = 167.178 + 0.05 + i * 0.25;
        pose.tracker_from_tool.translation = {0, 0, double(i)};
        made.needle.push_back(pose);
    }
    ReplayTracker replay(made, true);
    TrackerReading reading;
    for (int i = 0; i < 10; ++i) {
        ASSERT_TRUE(replay.poll(replay.recorded_time_s(i), reading));
        const double t = 0.1 * i;
        const double chosen = reading.sensors[kNeedleSensor].world_from_sensor.translation.z;
        for (int j = 0; j < 4; ++j) {
            EXPECT_LE(std::abs(0.05 + 0.25 * chosen - t), std::abs(0.05 + 0.25 * j - t) + 1e-9);
        }
    }
}

TEST(ReplayTracker, OfASingleRowShowsItOnce) {
    ReplayTracker replay(recording(1, 0.1), true);
    TrackerReading reading;
    EXPECT_TRUE(replay.poll(1, reading));
    EXPECT_FALSE(replay.poll(2, reading));
    EXPECT_EQ(replay.duration_s(), 0);
}

TEST(ReplayTracker, StartsOverWhenItLoopsAndEndsWhenNot) {
    ReplayTracker round(recording(3, 0.1), true);
    TrackerReading reading;
    round.poll(0, reading);
    EXPECT_TRUE(round.poll(0.25, reading));
    EXPECT_EQ(reading.sensors[kProbeSensor].world_from_sensor.translation.x, 0);
    ReplayTracker once(recording(3, 0.1), false);
    once.poll(0, reading);
    once.poll(0.25, reading);
    EXPECT_EQ(reading.sensors[kProbeSensor].world_from_sensor.translation.x, 2);
    EXPECT_EQ(once.health().phase, TrackerPhase::ended);
}

}  // namespace
}  // namespace sonocase::runtime
