// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/scan_engine.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include "support/random.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

TEST(ToolPoses, UndoCalibrationsExactly) {
    sonocase::testing::Random random(7);
    for (int n = 0; n < 100; ++n) {
        const Rigid mannequin_from_probe = random.rigid(200);
        Calibrations calibrations;
        calibrations.probe.emplace();
        calibrations.probe->sensor_from_tool = random.rigid(60);
        calibrations.mannequin.emplace();
        calibrations.mannequin->sensor_from_tool = random.rigid(500);
        calibrations.mannequin->scale = random.uniform(0.8, 1.2);
        Rigid scaled = mannequin_from_probe;
        scaled.translation = calibrations.mannequin->scale * scaled.translation;
        TrackerReading reading;
        reading.sensor_count = 4;
        reading.sensors[3].state = SensorState::ok;
        reading.sensors[3].world_from_sensor = calibrations.mannequin->sensor_from_tool * scaled *
                                               inverse(calibrations.probe->sensor_from_tool);
        const ToolPoses tools = tool_poses(reading, calibrations, {3, -1});
        ASSERT_TRUE(tools.has_probe);
        EXPECT_FALSE(tools.has_needle);
        // 1e-9 mm: a few roundings of lengths near a metre.
        EXPECT_LT(norm(tools.mannequin_from_probe.translation - mannequin_from_probe.translation),
                  1e-9);
        EXPECT_LT(rotation_angle(transpose(tools.mannequin_from_probe.rotation) *
                                 mannequin_from_probe.rotation),
                  1e-7);
    }
}

TEST(ToolPoses, LeaveScriptedPosesAlone) {
    Calibrations calibrations;
    calibrations.probe.emplace();
    calibrations.probe->sensor_from_tool.translation = {1, 2, 3};
    TrackerReading reading;
    reading.in_mannequin = true;
    reading.sensor_count = 2;
    reading.sensors[0].state = SensorState::ok;
    reading.sensors[0].world_from_sensor.translation = {9, 8, 7};
    const ToolPoses tools = tool_poses(reading, calibrations, {5, 6});
    ASSERT_TRUE(tools.has_probe);
    EXPECT_EQ(tools.mannequin_from_probe.translation, (Vector3{9, 8, 7}));
}

class Engine : public ::testing::Test {
  protected:
    void SetUp() override {
        options_.render.model = ImageModel::paper;
        options_.render.width_px = options_.render.height_px = 96;
    }
    TrackerReading reading(double y, SensorState state = SensorState::ok) {
        TrackerReading r;
        r.sequence = ++sequence_;
        r.time_s = 0.01 * static_cast<double>(sequence_);
        r.sensor_count = 1;
        r.sensors[0].state = state;
        r.sensors[0].world_from_sensor = {rotation_about({1, 0, 0}, kPi), {0, y, 59}};
        return r;
    }
    CaseBundle bundle_ = sonocase::testing::small_case();
    Exercise exercise_ = sonocase::testing::small_exercise();
    EngineOptions options_;
    std::uint64_t sequence_ = 0;
};

TEST_F(Engine, RendersAPastFrameAgainToTheSameBytes) {
    auto engine = ScanEngine::create(bundle_, exercise_, options_);
    ASSERT_TRUE(engine) << engine.error().message();
    std::vector<std::uint8_t> first(96 * 96), later(96 * 96), again(96 * 96);
    engine->observe(reading(-20), false);
    EXPECT_EQ(engine->frame(1.0, {}, first), FrameStatus::rendered);
    const FrameRecord record = engine->last();
    for (int i = 0; i < 5; ++i) {
        engine->observe(reading(5.0 * i), false);
        engine->frame(1.1 + i, {}, later);
    }
    EXPECT_NE(first, later);
    engine->frame_again(record, again);
    EXPECT_EQ(first, again);
}

TEST_F(Engine, KeepsTheLastPlaceOfALostProbe) {
    auto engine = ScanEngine::create(bundle_, exercise_, options_);
    ASSERT_TRUE(engine);
    std::vector<std::uint8_t> pixels(96 * 96);
    engine->observe(reading(-20), true);
    engine->frame(0, {}, pixels);
    const Rigid before = engine->last().input.mannequin_from_probe;
    engine->observe(reading(30, SensorState::lost), true);
    engine->frame(0.1, {}, pixels);
    EXPECT_EQ(engine->last().input.mannequin_from_probe, before);
    EXPECT_EQ(engine->probe_verdict(0.02), SensorVerdict::lost);
}

TEST_F(Engine, HoldsThePictureOnAPoseThatIsNoNumber) {
    auto engine = ScanEngine::create(bundle_, exercise_, options_);
    ASSERT_TRUE(engine);
    std::vector<std::uint8_t> good(96 * 96);
    engine->observe(reading(0), true);
    engine->frame(0, {}, good);
    std::vector<std::uint8_t> held = good;
    TrackerReading bad = reading(0);
    bad.sensors[0].world_from_sensor.translation.x = NAN;
    engine->observe(bad, true);
    EXPECT_EQ(engine->frame(0.1, {}, held), FrameStatus::held_bad_pose);
    EXPECT_EQ(good, held);
}

TEST_F(Engine, DarkensWithoutContact) {
    auto engine = ScanEngine::create(bundle_, exercise_, options_);
    ASSERT_TRUE(engine);
    std::vector<std::uint8_t> on(96 * 96), off(96 * 96);
    engine->observe(reading(0), false);
    EXPECT_EQ(engine->frame(0, {}, on), FrameStatus::rendered);
    TrackerReading lifted = reading(0);
    lifted.sensors[0].world_from_sensor.translation.z = 90;
    engine->observe(lifted, false);
    EXPECT_EQ(engine->frame(0, {}, off), FrameStatus::no_contact);
    const auto sum = [](const std::vector<std::uint8_t>& v) {
        double total = 0;
        for (std::uint8_t p : v) total += p;
        return total;
    };
    EXPECT_LT(sum(off), 0.25 * sum(on));
}

}  // namespace
}  // namespace sonocase::runtime
