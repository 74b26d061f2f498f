// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/setup_guide.h"

#include <gtest/gtest.h>

#include "support/random.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

// A user who does what is asked, with sensors mounted in a known way and 0.1 mm of noise.
class User {
  public:
    explicit User(SetupGuide& guide) : guide_(guide) {}
    const Rigid sensor_from_probe{rotation_about(normalized(Vector3{1, 2, -1}), 0.8), {12, -7, 45}};
    const Rigid sensor_from_needle{rotation_about(normalized(Vector3{0, 1, 0.3}), 0.4),
                                   {-3, 5, 120}};
    const Rigid world_from_mannequin{rotation_about({0, 0, 1}, 0.5), {300, -40, 20}};

    void show(const Rigid& world_from_probe, const Rigid& world_from_needle) {
        TrackerReading reading;
        reading.sequence = ++sequence_;
        reading.time_s = static_cast<double>(sequence_) / 60;
        reading.sensor_count = 2;
        Rigid poses[] = {world_from_probe * inverse(sensor_from_probe),
                         world_from_needle * inverse(sensor_from_needle)};
        for (int i = 0; i < 2; ++i) {
            for (int a = 0; a < 3; ++a) poses[i].translation[a] += 0.1 * random_.gaussian();
            reading.sensors[i] = {SensorState::ok, poses[i], 1.0f, 0};
        }
        guide_.observe(reading, {}, reading.time_s);
    }
    Matrix3 tilted(double most_rad) {
        return rotation_about(random_.direction(), random_.uniform(0, most_rad));
    }
    sonocase::testing::Random& random() { return random_; }

  private:
    SetupGuide& guide_;
    sonocase::testing::Random random_{23};
    std::uint64_t sequence_ = 0;
};

TEST(SetupGuide, FindsAllThreeCalibrations) {
    CaseBundle bundle = sonocase::testing::small_case();
    for (int i = 0; i < 72; ++i) {  // the cylinder's skin, one point every 5 mm
        for (int j = 0; j < 31; ++j) {
            const double angle = i * 0.0872664626;
            const Vector3 out{std::cos(angle), 0, std::sin(angle)};
            bundle.mannequin_skin.points.push_back(Point3{0, -75 + 5.0 * j, 0} + 60 * out);
            bundle.mannequin_skin.normals.push_back(out);
        }
    }
    SetupGuide guide(bundle);
    User user(guide);
    const Rigid rest{Matrix3{}, {250, 30, 80}};
    EXPECT_FALSE(guide.calibrations("x", "").probe);

    guide.go_to(SetupStep::probe_tip);
    guide.record(true);
    for (int i = 0; i < 300; ++i) user.show({user.tilted(0.9), {250, 30, 80}}, rest);
    guide.record(false);
    EXPECT_TRUE(guide.view().good_enough) << guide.view().sentence;

    for (const auto& [step, axis] : {std::pair{SetupStep::probe_depth, Vector3{0, 0, 1}},
                                     std::pair{SetupStep::probe_lateral, Vector3{1, 0, 0}}}) {
        guide.go_to(step);
        guide.record(true);
        const Matrix3 held = user.tilted(1);
        for (int i = 0; i < 200; ++i) {
            const Vector3 at = Vector3{200, 0, 50} + (0.5 * i) * (held * axis);
            user.show({held, at}, rest);
        }
        guide.record(false);
        EXPECT_TRUE(guide.view().good_enough) << guide.view().sentence;
    }
    ASSERT_TRUE(guide.probe_ready());

    guide.go_to(SetupStep::needle);
    for (double depth_mm : {60.0, 30.0, 0.0}) {
        guide.record(true);
        for (int i = 0; i < 200; ++i) {
            const Matrix3 turn = user.tilted(0.8);
            const Vector3 tip = Vector3{100, 20, 10} + depth_mm * turn.column(2);
            user.show(rest, {turn, tip});
        }
        guide.record(false);
    }
    EXPECT_TRUE(guide.view().good_enough) << guide.view().sentence;

    guide.go_to(SetupStep::mannequin);
    guide.record(true);
    for (int i = 0; i < 900; ++i) {
        // Past the middle on one side only: on a whole cylinder, turns about its axis do not show.
        const double angle = user.random().uniform(0.2, 2.9), y = user.random().uniform(-70, 70);
        const Point3 p{60 * std::cos(angle), y, 60 * std::sin(angle)};
        const Point3 world = user.world_from_mannequin * p;
        user.show({user.tilted(0.5), {world.x, world.y, world.z}}, rest);
    }
    guide.record(false);

    const Calibrations found = guide.calibrations("Viper", "2026-01-01T00:00:00Z");
    ASSERT_TRUE(found.probe && found.needle);
    EXPECT_EQ(found.probe->sensor, "Viper");
    // Noise of 0.1 mm over hundreds of readings: tenths of a millimetre and of a degree.
    EXPECT_LT(norm(found.probe->sensor_from_tool.translation - user.sensor_from_probe.translation),
              0.3);
    EXPECT_LT(rotation_angle(transpose(found.probe->sensor_from_tool.rotation) *
                             user.sensor_from_probe.rotation),
              0.01);
    EXPECT_LT(
        norm(found.needle->sensor_from_tool.translation - user.sensor_from_needle.translation),
        0.5);
    EXPECT_GT(dot(found.needle->sensor_from_tool.rotation.column(2),
                  user.sensor_from_needle.rotation.column(2)),
              std::cos(0.01));
    // A sweep of a cylinder does not determine turns about its axis; either the guide says so, or
    // what it found is on the skin.
    if (found.mannequin) {
        EXPECT_LT(found.mannequin->rms_mm, 2);
    } else {
        EXPECT_FALSE(guide.view().sentence.empty());
    }
}

TEST(SetupGuide, AsksForMoreWhereThereIsTooLittle) {
    const CaseBundle bundle = sonocase::testing::small_case();
    SetupGuide guide(bundle);
    User user(guide);
    guide.go_to(SetupStep::probe_tip);
    guide.record(true);
    for (int i = 0; i < 100; ++i) user.show({user.tilted(0.05), {0, 0, 0}}, {});
    guide.record(false);
    EXPECT_FALSE(guide.view().good_enough);
    EXPECT_FALSE(guide.view().sentence.empty());
    EXPECT_FALSE(guide.calibrations("x", "").probe);
    guide.go_to(SetupStep::mannequin);
    EXPECT_FALSE(guide.recording());
    guide.clear_step();
    EXPECT_EQ(guide.view().readings, 0);
}

TEST(SetupGuide, TakesNoScriptedPoses) {
    const CaseBundle bundle = sonocase::testing::small_case();
    SetupGuide guide(bundle);
    guide.go_to(SetupStep::probe_tip);
    guide.record(true);
    TrackerReading reading;
    reading.in_mannequin = true;
    reading.sequence = 1;
    reading.sensor_count = 1;
    reading.sensors[0].state = SensorState::ok;
    guide.observe(reading, {}, 1);
    EXPECT_EQ(guide.view().readings, 0);
}

TEST(TiltFields, FillWithTheDirectionsThatATiltedToolHasHad) {
    const Vector3 tip{0, 0, -100};  // the sensor stands 100 mm above the pin
    std::vector<Pose> poses;
    const auto lean = [&](double rad, double turn) {
        Pose pose;
        pose.ok = true;
        pose.tracker_from_tool.rotation = rotation_about({std::cos(turn), std::sin(turn), 0}, rad);
        poses.push_back(pose);
    };
    EXPECT_FALSE(tilt_fields(poses, tip));
    lean(0, 0);
    ASSERT_TRUE(tilt_fields(poses, tip));
    EXPECT_EQ(tilt_fields(poses, tip)->count(), 1);
    EXPECT_TRUE(tilt_fields(poses, tip)->leaned[0]);
    for (int i = 0; i < 60; ++i) {
        lean(0.25, i * 0.10471976);
        lean(0.5, i * 0.10471976);
    }
    EXPECT_EQ(tilt_fields(poses, tip)->count(), TiltFields::kCount);
    const auto now = tilt_fields(poses, tip);
    EXPECT_NEAR(std::hypot(now->x_rad, now->y_rad), 0.5, 0.02);
    // A sensor on the tip shows no lean.
    EXPECT_FALSE(tilt_fields(poses, {0, 0, 1}));
}

}  // namespace
}  // namespace sonocase::runtime
