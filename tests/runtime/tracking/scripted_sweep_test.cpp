// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/scripted_sweep.h"

#include <gtest/gtest.h>

#include "runtime/tracking/replay_tracker.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

Point3 face(const SweepPose& pose) {
    return pose.mannequin_from_probe * Point3{0, 0, 0};
}

TEST(ScriptedSweep, MeetsEveryKey) {
    const Exercise exercise = sonocase::testing::small_exercise();
    Sweep sweep = exercise.sweeps[0];
    sweep.snap_to_skin = false;
    for (const SweepKey& key : sweep.keys) {
        const SweepPose pose = sweep_pose(sweep, key.time_s, nullptr);
        EXPECT_LT(distance(face(pose), key.probe), 1e-9);
        ASSERT_TRUE(pose.has_needle);
        EXPECT_LT(distance(pose.mannequin_from_needle * Point3{0, 0, 0}, key.needle_tip), 1e-9);
        EXPECT_GT(dot(pose.mannequin_from_needle.rotation.column(2), key.needle_direction),
                  1 - 1e-12);
    }
}

TEST(ScriptedSweep, StaysAtConstantSpeedOnAStraightScript) {
    Sweep sweep = sonocase::testing::small_exercise().sweeps[0];
    sweep.snap_to_skin = false;
    for (double t = 0; t <= 2; t += 0.05) {
        EXPECT_NEAR(face(sweep_pose(sweep, t, nullptr)).y, -30 + 30 * t, 1e-9) << t;
    }
}

TEST(ScriptedSweep, IsContinuousAndRigidThroughKeys) {
    Sweep sweep;
    for (int i = 0; i < 5; ++i) {
        SweepKey key;
        key.time_s = i * 0.7 + (i % 2) * 0.2;
        key.probe = {10.0 * i, 5.0 * (i % 3), 60.0 - i * i};
        key.beam = normalized(Vector3{0.2 * i - 0.4, 0.3, -1});
        key.lateral = normalized(Vector3{1, 0.2 * i, 0});
        sweep.keys.push_back(key);
    }
    SweepPose last = sweep_pose(sweep, -1, nullptr);
    for (double t = -1; t < 4; t += 1e-3) {
        const SweepPose pose = sweep_pose(sweep, t, nullptr);
        EXPECT_LT(orthonormality_error(pose.mannequin_from_probe.rotation), 1e-12);
        EXPECT_GT(determinant(pose.mannequin_from_probe.rotation), 0);
        EXPECT_LT(distance(face(pose), face(last)), 0.1);  // 100 mm/s at the most
        last = pose;
    }
}

TEST(ScriptedSweep, IsPutOnTheSkinWhenAsked) {
    const CaseBundle bundle = sonocase::testing::small_case();
    const Skin skin(bundle);
    const Sweep sweep = sonocase::testing::small_exercise().sweeps[0];
    for (double t = 0; t <= 2; t += 0.1) {
        // 1.8 mm: half the diagonal of the 2 mm voxels.
        EXPECT_NEAR(face(sweep_pose(sweep, t, &skin)).z, 60, 1.8);
    }
}

TEST(ScriptedSweep, ShowsTheNeedleOnlyBetweenKeysThatHaveOne) {
    Sweep sweep = sonocase::testing::small_exercise().sweeps[0];
    sweep.keys[0].has_needle = false;
    EXPECT_FALSE(sweep_pose(sweep, 0.5, nullptr).has_needle);
    EXPECT_TRUE(sweep_pose(sweep, 1.5, nullptr).has_needle);
}

TEST(ScriptedSweep, EndsOrLoops) {
    const CaseBundle bundle = sonocase::testing::small_case();
    const Skin skin(bundle);
    const Sweep sweep = sonocase::testing::small_exercise().sweeps[0];
    TrackerReading reading;
    ScriptedSweep once(sweep, skin, false);
    EXPECT_TRUE(once.poll(10, reading));
    EXPECT_EQ(once.health().phase, TrackerPhase::streaming);
    EXPECT_TRUE(once.poll(12.5, reading));
    EXPECT_EQ(once.health().phase, TrackerPhase::ended);
    EXPECT_EQ(reading.device_time_s, 2.5);
    ScriptedSweep round(sweep, skin, true);
    round.poll(10, reading);
    const Rigid first = reading.sensors[kProbeSensor].world_from_sensor;
    round.poll(14, reading);  // two laps of 2 s
    EXPECT_EQ(reading.sensors[kProbeSensor].world_from_sensor, first);
    EXPECT_EQ(round.health().phase, TrackerPhase::streaming);
}

// An attempt may outlast its script: if the script started over, its next puncture would be scored.
TEST(ScriptedSweep, StandsAtItsEndWhereItIsAskedTo) {
    const CaseBundle bundle = sonocase::testing::small_case();
    const Skin skin(bundle);
    Sweep sweep = sonocase::testing::small_exercise().sweeps[0];
    sweep.keys.back().acts.add({ActKind::inject, 0, 1});  // performed at the very end, and once
    const double end_s = sweep.keys.back().time_s;
    const Point3 last = face(sweep_pose(sweep, end_s, &skin));
    PacedTracker paced(std::make_unique<ScriptedSweep>(sweep, skin, true));
    TrackerReading reading;
    int acts = 0;
    const auto place_at = [&](double now_s) {
        EXPECT_TRUE(paced.poll(now_s, reading));
        acts += reading.acts.count;
        return Point3{} + reading.sensors[kProbeSensor].world_from_sensor.translation;
    };
    place_at(10);
    place_at(12.5);  // in the second round
    paced.stand_at_end(true);
    for (const double now_s : {14.2, 15.0, 60.0}) EXPECT_LT(distance(place_at(now_s), last), 1e-3);
    EXPECT_EQ(acts, 1);
    paced.stand_at_end(false);
    const Point3 first = face(sweep_pose(sweep, sweep.keys.front().time_s, &skin));
    EXPECT_LT(distance(place_at(60.00001), first), 1e-2);
}

TEST(ScriptedSweep, OfOneKeyOrNoneStandsStill) {
    const CaseBundle bundle = sonocase::testing::small_case();
    const Skin skin(bundle);
    Sweep sweep = sonocase::testing::small_exercise().sweeps[0];
    sweep.keys.resize(1);
    sweep.snap_to_skin = false;
    EXPECT_EQ(face(sweep_pose(sweep, 5, nullptr)), sweep.keys[0].probe);
    TrackerReading reading;
    ScriptedSweep one(sweep, skin, true);
    EXPECT_TRUE(one.poll(3, reading));
    sweep.keys.clear();
    ScriptedSweep none(sweep, skin, true);
    EXPECT_FALSE(none.poll(3, reading));
}

TEST(FrameAlong, IsARotationForEveryDirectionAndHint) {
    for (const Vector3 z :
         {Vector3{1, 0, 0}, Vector3{0, -1, 0}, Vector3{0, 0, 2}, Vector3{0, 0, 0}}) {
        for (const Vector3 x : {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 0}}) {
            const Rigid frame = frame_along({1, 2, 3}, z, x);
            EXPECT_LT(orthonormality_error(frame.rotation), 1e-12);
            EXPECT_NEAR(determinant(frame.rotation), 1, 1e-12);
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
