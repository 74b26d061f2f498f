// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/scan_engine.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/scoring/tool_track.h"
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

// A mannequin that is moved with the sensor fixed to it changes nothing; poses that are in the
// mannequin or relative to the reference already are left as they are; a recording's tools have
// their places whatever is assigned.
TEST(ToolPoses, AreRelativeToTheReference) {
    sonocase::testing::Random random(11);
    const Rigid mannequin_from_reference = random.rigid(200);
    Calibrations calibrations;
    calibrations.mannequin.emplace();
    calibrations.mannequin->sensor_from_tool = inverse(mannequin_from_reference);
    for (int n = 0; n < 100; ++n) {
        const Rigid world_from_mannequin = random.rigid(900);
        const Rigid probe = random.rigid(200), needle = random.rigid(200);
        TrackerReading reading;
        reading.sensor_count = 3;
        for (SensorReading& s : reading.sensors) s.state = SensorState::ok;
        reading.sensors[2].world_from_sensor = world_from_mannequin * probe;
        reading.sensors[1].world_from_sensor = world_from_mannequin * mannequin_from_reference;
        reading.sensors[0].world_from_sensor = inverse(mannequin_from_reference) * needle;
        reading.sensors[0].in_reference = true;
        const SensorAssignment places{2, 0, 1};
        ToolPoses tools = tool_poses(reading, calibrations, places);
        ASSERT_TRUE(tools.has_probe && tools.has_needle);
        // 1e-9 mm: a few roundings of lengths near a metre.
        EXPECT_LT(norm(tools.mannequin_from_probe.translation - probe.translation), 1e-9);
        EXPECT_LT(rotation_angle(transpose(tools.mannequin_from_probe.rotation) * probe.rotation),
                  1e-7);
        EXPECT_LT(norm(tools.mannequin_from_needle.translation - needle.translation), 1e-9);
        reading.sensors[2].in_mannequin = true;
        EXPECT_EQ(tool_poses(reading, calibrations, places).mannequin_from_probe.translation,
                  reading.sensors[2].world_from_sensor.translation);
        reading.sensors[2].in_mannequin = false;
        reading.sensors[1].state = SensorState::lost;
        tools = tool_poses(reading, calibrations, places);
        EXPECT_FALSE(tools.has_probe);
        EXPECT_TRUE(tools.has_needle);  // does not depend on it
        reading.placed = true;
        EXPECT_EQ(sensor_pose(reading, places_of(reading, places), 2)->translation,
                  reading.sensors[2].world_from_sensor.translation);
    }
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

// Whatever happens to the reference, in every way in which a sensor is lost, nothing is placed by a
// pose of it that is old, and both tools come back with it. As a device with numbered sensors sends
// them, all at once, and as a stream does, each with a time of its own.
TEST_F(Engine, ToolsAreLostWithTheReferenceAndComeBack) {
    enum Way { silent, said, not_a_number, at_identity, repeated, kWays };
    for (const bool own_times : {false, true}) {
        for (int way = own_times ? 0 : 1; way < kWays; ++way) {
            SCOPED_TRACE(std::to_string(way) + (own_times ? ", own times" : ""));
            auto engine = ScanEngine::create(bundle_, exercise_, options_);
            ASSERT_TRUE(engine);
            engine->set_assignment({0, 1, 2});
            std::vector<std::uint8_t> pixels(96 * 96);
            sonocase::testing::Random random(5);
            const auto noise = [&] { return random.uniform(-0.05, 0.05); };
            double t = 0;
            TrackerReading r;
            r.sensor_count = 3;
            const auto step = [&](bool seen) {
                t += 1 / 60.0;
                r.time_s = t;
                ++r.sequence;
                // The table with the mannequin is pushed about at 100 mm/s.
                const Rigid world{{}, {100 * t, 0, 500}};
                const Rigid probe{rotation_about({1, 0, 0}, kPi), {noise(), 10 * std::sin(t), 59}};
                const auto set = [&](SensorReading& s, const Rigid& pose) {
                    s.state = SensorState::ok;
                    s.world_from_sensor = pose;
                    if (own_times) s.time_s = t;
                };
                set(r.sensors[0], world * probe);
                set(r.sensors[1], world * Rigid{{}, {30 + noise(), 0, 80}});
                SensorReading& reference = r.sensors[2];
                if (seen) {
                    set(reference, world * Rigid{{}, {noise(), 0, 0}});
                } else {
                    if (own_times && way != silent) reference.time_s = t;
                    if (way == said) reference.state = SensorState::lost;
                    if (way == not_a_number) reference.world_from_sensor.translation.x = NAN;
                    if (way == at_identity) reference.world_from_sensor = {};
                }
                engine->observe(r, true);
                engine->frame(t, {}, pixels);
                return engine->last().tools;
            };
            for (int i = 0; i < 60; ++i) {
                const ToolPoses tools = step(true);
                ASSERT_TRUE(tools.has_probe && tools.has_needle) << i;
                ASSERT_LT(std::abs(tools.mannequin_from_probe.translation.z - 59), 1e-9);
                ASSERT_LT(std::abs(tools.mannequin_from_probe.translation.x), 0.11);
            }
            for (int i = 0; i < 60; ++i) {
                const ToolPoses tools = step(false);
                if (i >= 18) {  // 0.3 s
                    EXPECT_FALSE(tools.has_probe || tools.has_needle) << i;
                }
            }
            const SensorVerdict verdict = engine->reference_verdict(t);
            EXPECT_TRUE(verdict == SensorVerdict::lost || verdict == SensorVerdict::stale);
            ToolPoses tools;
            for (int i = 0; i < 4; ++i) tools = step(true);
            EXPECT_TRUE(tools.has_probe && tools.has_needle);
            EXPECT_LT(std::abs(tools.mannequin_from_probe.translation.x), 0.11);
            // Without a reference it is of no concern.
            engine->set_assignment({0, 1, -1});
            for (int i = 0; i < 30; ++i) tools = step(false);
            EXPECT_TRUE(tools.has_probe && tools.has_needle);
        }
    }
}

// One live sensor never vouches for another. In each of the ways in which senders say that a tool
// is lost, or say nothing, random drop-outs: the tool is gone within 0.3 s, no pose is shown that
// was not measured, and the recording's gap is the true one.
TEST_F(Engine, ALostToolIsLostInEveryWayOfSayingSo) {
    options_.render.width_px = options_.render.height_px = 16;
    options_.render.scanlines = 8;
    options_.render.samples = 16;
    enum Way {
        silent,
        said,
        not_a_number,
        missing_number,
        at_identity,
        at_origin,
        repeated,
        kWays
    };
    sonocase::testing::Random random(43);
    constexpr double kStep = 1 / 30.0;
    for (int way = 0; way < kWays; ++way) {
        auto engine = ScanEngine::create(bundle_, exercise_, options_);
        ASSERT_TRUE(engine);
        std::vector<std::uint8_t> pixels(16 * 16);
        TrackerReading reading;
        reading.sensor_count = 3;
        // A reference of its own frame in the same stream says nothing about the tools.
        reading.sensors[2].state = SensorState::ok;
        for (int i : {0, 1}) reading.sensors[i].in_mannequin = true;
        const auto noisy = [&](Vector3 at) {
            return Rigid{rotation_about({1, 0, 0}, kPi),
                         at + Vector3{random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), 0}};
        };
        double t = 0;
        const auto needle_at = [&](double s) {
            return Vector3{20 + 8 * s, 10 * std::cos(0.7 * s), 80};  // 8 mm/s and more
        };
        Session session;
        double last_measured = 0;
        const auto step = [&](bool seen) {
            t += kStep;
            ++reading.sequence;
            reading.time_s = t;
            for (const int i : {0, 2}) {
                reading.sensors[i].state = SensorState::ok;
                reading.sensors[i].time_s = t;
                reading.sensors[i].world_from_sensor = noisy({0, 5 * std::sin(t), 59});
            }
            SensorReading& needle = reading.sensors[1];
            const bool frozen = !seen && way == repeated;
            if (seen || way != silent) needle.time_s = t;
            if (seen) {
                needle.state = SensorState::ok;
                needle.world_from_sensor = noisy(needle_at(t));
                last_measured = t;
            } else if (way == said) {
                needle.state = SensorState::lost;
                needle.world_from_sensor = noisy({0, 0, 0});
            } else if (way == not_a_number) {
                needle.world_from_sensor.translation.x = NAN;
            } else if (way == missing_number) {
                needle.world_from_sensor.translation = -3.697314e28 * Vector3{1, 1, 1};
            } else if (way == at_identity) {
                needle.world_from_sensor = {};
            } else if (way == at_origin) {
                needle.world_from_sensor.translation = {};
            }
            engine->observe(reading, true);
            engine->frame(t, {}, pixels);
            const ToolPoses& tools = engine->last().tools;
            EXPECT_TRUE(tools.has_probe);
            if (tools.has_needle) {
                EXPECT_LE(t - last_measured, 0.3) << way;
                // Where it was when it was measured, the noise apart.
                EXPECT_LT(norm(tools.mannequin_from_needle.translation - needle_at(last_measured)),
                          frozen ? 0.2 : 0.9)
                    << way << " at " << t;
            }
            SessionSample sample;
            fill_sample(engine->last(), sample);
            session.samples.push_back(sample);
        };
        for (int drop = 0; drop < 20; ++drop) {
            session.samples.clear();
            const double seen_s = random.uniform(1, 2), lost_s = random.uniform(0.4, 5);
            for (const double end = t + seen_s; t < end;) step(true);
            const double from = t;
            for (const double end = t + lost_s; t < end;) step(false);
            EXPECT_FALSE(engine->last().tools.has_needle) << way;
            step(true);
            const double to = t;
            step(true);
            EXPECT_TRUE(engine->last().tools.has_needle) << way;
            const ToolTrack track = track_of(session, Tool::needle);
            // A frame's time, and that of one that was held back until a second confirmed it.
            EXPECT_NEAR(track.longest_gap_s, to - from, 0.05) << way << " drop " << drop;
        }
    }
}

// A sender that sees neither tool from its start on sends identities; a mouse or a recording may
// well put a tool at the origin.
TEST_F(Engine, ToolsOfADeviceAtTheOriginAreLostFromTheStart) {
    for (const bool is_device : {true, false}) {
        auto engine = ScanEngine::create(bundle_, exercise_, options_);
        ASSERT_TRUE(engine);
        std::vector<std::uint8_t> pixels(96 * 96);
        for (int i = 0; i < 10; ++i) {
            TrackerReading r = reading(0);
            r.in_mannequin = !is_device;
            r.sensor_count = 2;
            for (const int s : {0, 1}) {
                r.sensors[s].state = SensorState::ok;
                r.sensors[s].world_from_sensor = {};
            }
            engine->observe(r, is_device);
            engine->frame(r.time_s, {}, pixels);
            EXPECT_NE(engine->last().tools.has_probe, is_device);
            EXPECT_NE(engine->last().tools.has_needle, is_device);
            EXPECT_EQ(engine->probe_verdict(r.time_s),
                      is_device ? SensorVerdict::lost : SensorVerdict::fine);
        }
    }
}

// A simulated sender may hold still to the last bit, and goes on from there.
TEST_F(Engine, WhatRestsToTheLastBitAndGoesOnFromThereIsNoSensor) {
    auto engine = ScanEngine::create(bundle_, exercise_, options_);
    ASSERT_TRUE(engine);
    SensorWatch watch;
    int lost = 0;
    double x = 0;
    for (int i = 0; i < 1200; ++i) {
        const bool rests = i / 60 % 2 == 1;
        if (!rests) x += 0.5;
        SensorReading s;
        s.state = SensorState::ok;
        s.world_from_sensor.translation.x = x;
        watch.observe(s, i / 60.0, true, true);
        lost += watch.lost(i / 60.0);
    }
    EXPECT_LE(lost, 60);  // the first rest only
}

TEST_F(Engine, APoseThatIsNoNumberIsLostAndThePictureStays) {
    auto engine = ScanEngine::create(bundle_, exercise_, options_);
    ASSERT_TRUE(engine);
    std::vector<std::uint8_t> good(96 * 96);
    engine->observe(reading(0), true);
    engine->frame(0, {}, good);
    std::vector<std::uint8_t> held = good;
    // Of a device and of a recording.
    for (const auto& [number, is_device] :
         {std::pair(NAN, true), {-3.697314e28, true}, {-3.697314e28, false}}) {
        TrackerReading bad = reading(0);
        bad.in_mannequin = true;
        bad.sensors[0].world_from_sensor.translation.x = number;
        engine->observe(bad, is_device);
        const Rigid before = engine->last().input.mannequin_from_probe;
        engine->frame(bad.time_s, {}, held);
        EXPECT_EQ(engine->last().input.mannequin_from_probe, before);
        EXPECT_FALSE(engine->last().tools.has_probe);
    }
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
