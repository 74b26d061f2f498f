// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/replay_tracker.h"

#include <gtest/gtest.h>

#include "runtime/tracking/devices/make_tracker.h"
#include "support/temporary_folder.h"

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

TEST(ReplayTracker, ACalibratedLagBringsTheNeedleToItsOwnMoment) {
    const sonocase::testing::TemporaryFolder folder;
    std::string probe = "frame,timestamp_s,status,tx,ty,tz,r00,r01,r02,r10,r11,r12,r20,r21,r22\n",
                needle = probe;
    for (int i = 0; i < 40; ++i) {  // both move together; the needle's readings come 0.15 s late
        const std::string rest = ",0,0,1,0,0,0,1,0,0,0,1\n";
        const double t = 0.05 * i;
        probe += std::to_string(i) + "," + std::to_string(t) + ",OK," + std::to_string(i) + rest;
        needle +=
            std::to_string(i) + "," + std::to_string(t + 0.15) + ",OK," + std::to_string(i) + rest;
    }
    folder.write("probe.csv", probe);
    folder.write("needle.csv", needle);
    for (const double lag_s : {0.0, 0.15}) {
        TrackerContext context;
        context.needle_lag_s = lag_s;
        auto tracker = make_tracker(
            "replay:" + (folder / "probe.csv") + "," + (folder / "needle.csv"), context);
        ASSERT_TRUE(tracker) << tracker.error().message();
        TrackerReading reading;
        ASSERT_TRUE((*tracker)->poll(0, reading));
        ASSERT_TRUE((*tracker)->poll(1, reading));
        EXPECT_EQ(reading.sensors[kProbeSensor].world_from_sensor.translation.x, 20);
        EXPECT_EQ(reading.sensors[kNeedleSensor].world_from_sensor.translation.x,
                  lag_s > 0 ? 20 : 17);
    }
}

std::string table(
    int rows, double start_s, double scale, double fall_at = -1, double step_s = 0.05) {
    std::string text = "frame,timestamp_s,status,tx,ty,tz,r00,r01,r02,r10,r11,r12,r20,r21,r22\n";
    for (int i = 0; i < rows; ++i) {
        const double t = start_s + step_s * i - (i == fall_at ? 1 : 0);
        text += std::to_string(i) + "," + std::to_string(t) + ",OK," +
                std::to_string(scale * (100 + i)) + ",0,0,1,0,0,0,1,0,0,0,1\n";
    }
    return text;
}

TEST(ReplayTracker, TwoClocksAreRefusedUnlessTheirLagIsKnown) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string probe = folder.write("probe.csv", table(100, 0, 1)),
                      needle = folder.write("needle.csv", table(100, 1.7e9, 1));
    const auto refused = load_recording(probe + "," + needle);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message().find("one clock"), std::string::npos);
    const auto tied = load_recording(probe + "," + needle, 1.7e9);
    ASSERT_TRUE(tied) << tied.error().message();
    ReplayTracker replay(*tied, false);
    TrackerReading reading;
    ASSERT_TRUE(replay.poll(0, reading));
    ASSERT_TRUE(replay.poll(2, reading));
    EXPECT_EQ(reading.sensors[kNeedleSensor].state, SensorState::ok);
    EXPECT_EQ(reading.sensors[kNeedleSensor].world_from_sensor.translation.x, 140);
}

TEST(ReplayTracker, ANeedleThatBeginsLaterIsLostUntilThen) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string probe = folder.write("probe.csv", table(100, 0, 1)),
                      needle = folder.write("needle.csv", table(100, 3, 1));
    const auto recording = load_recording(probe + "," + needle);
    ASSERT_TRUE(recording) << recording.error().message();
    ReplayTracker replay(*recording, false);
    TrackerReading reading;
    for (int i = 0; i < 100; ++i) {
        ASSERT_TRUE(replay.poll(replay.recorded_time_s(i), reading));
        EXPECT_EQ(reading.sensors[kProbeSensor].state, SensorState::ok);
        // Within one step of the recording.
        if (i < 59) {
            EXPECT_EQ(reading.sensors[kNeedleSensor].state, SensorState::lost) << i;
        }
        if (i >= 60) {
            EXPECT_EQ(reading.sensors[kNeedleSensor].state, SensorState::ok) << i;
        }
    }
}

TEST(ReplayTracker, SaysWhatItLeavesOutAndRefusesMetresAndNoTimes) {
    const sonocase::testing::TemporaryFolder folder;
    const auto falling = load_recording(folder.write("f.csv", table(50, 0, 1, 30)));
    ASSERT_TRUE(falling) << falling.error().message();
    EXPECT_EQ(falling->probe.size(), 49u);
    EXPECT_NE(falling->note.find("1 of 50 readings were left out"), std::string::npos);
    const auto metres = load_recording(folder.write("m.csv", table(50, 0, 1e-3)));
    ASSERT_FALSE(metres);
    EXPECT_NE(metres.error().message().find("metres"), std::string::npos);
    const auto timeless = load_recording(
        folder.write("n.csv", "tx,ty,tz,qw,qx,qy,qz\n1,2,300,1,0,0,0\n1,2,301,1,0,0,0\n"));
    ASSERT_FALSE(timeless);
    EXPECT_NE(timeless.error().message().find("no times"), std::string::npos);
    const auto backwards = load_recording(folder.write("b.csv", table(50, 9, 1, -1, -0.05)));
    ASSERT_FALSE(backwards);
    EXPECT_NE(backwards.error().message().find("fall"), std::string::npos);
}

// Names of tools and of a reference, given as on the command line, hold for recordings too.
TEST(ReplayTracker, TakesToolsAndAReferenceByName) {
    const sonocase::testing::TemporaryFolder folder;
    std::string text = "timestamp_s,tool,tx,ty,tz,qw,qx,qy,qz\n";
    for (int i = 0; i < 20; ++i) {
        const std::string t = std::to_string(0.05 * i);
        text += t + ",0A," + std::to_string(100 + i) + ",0,300,1,0,0,0\n";
        text += t + ",0B," + std::to_string(200 + i) + ",0,300,1,0,0,0\n";
        text += t + ",0C," + std::to_string(10 + i) + ",0,200,1,0,0,0\n";
    }
    const std::string file = folder.write("handles.csv", text);
    const auto unnamed = load_recording(file);
    ASSERT_FALSE(unnamed);
    EXPECT_NE(unnamed.error().message().find("--tool probe="), std::string::npos);
    const auto named =
        load_recording(file, 0, {{"probe", "0A"}, {"needle", "0B"}, {"reference", "0C"}});
    ASSERT_TRUE(named) << named.error().message();
    ASSERT_EQ(named->probe.size(), 20u);
    EXPECT_NEAR(named->probe[7].tracker_from_tool.translation.x, 90, 1e-9);
    EXPECT_NEAR(named->needle[7].tracker_from_tool.translation.x, 190, 1e-9);
    EXPECT_NEAR(named->needle[7].tracker_from_tool.translation.z, 100, 1e-9);
    const auto wrong = load_recording(file, 0, {{"probe", "0Z"}});
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().message().find("0AToTracker"), std::string::npos);
}

TEST(PacedTracker, RunsSlowerFasterStandsStillAndJumps) {
    PacedTracker paced(std::make_unique<ReplayTracker>(recording(101, 0.1), true));
    TrackerReading reading;
    const auto x = [&] { return reading.sensors[kProbeSensor].world_from_sensor.translation.x; };
    EXPECT_EQ(paced.duration_s(), paced.recorded_time_s(100));
    ASSERT_TRUE(paced.poll(5, reading));
    EXPECT_EQ(x(), 0);
    EXPECT_TRUE(paced.poll(6.02, reading));  // in real time
    EXPECT_EQ(x(), 10);
    EXPECT_NEAR(reading.time_s, 6, 1e-9);  // when it was due
    paced.set_speed(0.25);
    EXPECT_TRUE(paced.poll(8.02, reading));
    EXPECT_EQ(x(), 15);
    paced.set_speed(4);
    EXPECT_TRUE(paced.poll(9.02, reading));
    EXPECT_EQ(x(), 55);
    paced.set_speed(0);
    EXPECT_FALSE(paced.poll(100, reading));
    paced.jump(-3);
    EXPECT_TRUE(paced.poll(101, reading));
    EXPECT_EQ(x(), 25);
    EXPECT_NEAR(paced.at_s(), 2.52, 1e-9);
    paced.jump(-5);  // past the start: from the end
    EXPECT_TRUE(paced.poll(102, reading));
    EXPECT_EQ(x(), 75);
    paced.set_speed(NAN);
    EXPECT_EQ(paced.speed(), 1);
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

// Situations in which a recording plays other tools than its owner thinks, or none.
TEST(LoadRecording, WhatIsNotPlayedOrDoesNotCountIsSaid) {
    const sonocase::testing::TemporaryFolder folder;
    const auto note_of = [&](const char* first, const char* second, const char* second_cells) {
        std::string text =
            "ObjectType = Image\nNDims = 3\nDimSize = 0 0 40\nElementType = "
            "MET_UCHAR\n";
        for (int i = 0; i < 40; ++i) {
            const std::string frame = "Seq_Frame" + std::to_string(i) + "_";
            text += frame + first + "Transform = 1 0 0 " + std::to_string(i) +
                    ".5 0 1 0 20 0 0 1 300 0 0 0 1\n" + frame + second +
                    "Transform = " + second_cells + "\n" + frame +
                    "Timestamp = " + std::to_string(0.05 * i) + "\n";
        }
        const std::string path = folder.write("r.mha", text + "ElementDataFile = LOCAL\n");
        const auto read = load_recording(path);
        EXPECT_TRUE(read) << read.error().message();
        return read ? std::string(read->note) : std::string();
    };
    const char* good = "1 0 0 9 0 1 0 20 0 0 1 300 0 0 0 1";
    EXPECT_EQ(note_of("ProbeToTracker", "NeedleToTracker", good), "");
    EXPECT_NE(
        note_of("Probe1ToTracker", "Probe2ToTracker", good).find("--tool probe=Probe2ToTracker"),
        std::string::npos);
    EXPECT_NE(note_of("ProbeToTracker", "NeedleToTracker",
                      "nan nan nan nan nan nan nan nan nan nan "
                      "nan nan 0 0 0 1")
                  .find("No pose of NeedleToTracker counts"),
              std::string::npos);
    EXPECT_NE(
        note_of("ProbeToTracker", "MarkerToTracker", good).find("--tool needle=MarkerToTracker"),
        std::string::npos);
    EXPECT_NE(note_of("ProbeToTracker", "ReferenceToTracker", good)
                  .find("--tool reference=ReferenceToTracker"),
              std::string::npos);
    EXPECT_NE(note_of("TrackerToProbe", "NeedleToTracker", good).find("inverse of TrackerToProbe"),
              std::string::npos);
}

}  // namespace
}  // namespace sonocase::runtime
