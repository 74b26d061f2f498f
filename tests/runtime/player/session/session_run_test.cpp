// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/session_run.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>

#include "runtime/player/session/clock.h"
#include "runtime/recording/session_words.h"
#include "runtime/tracking/replay_tracker.h"
#include "runtime/tracking/scripted_sweep.h"
#include "support/hard_case.h"
#include "support/random.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

std::unique_ptr<OpenCase> small_open_case() {
    auto open = std::make_unique<OpenCase>();
    open->bundle = StreamedBundle(testing::small_case());
    open->exercises = {testing::small_exercise()};
    return open;
}

ScanEngine engine_of(const OpenCase& open) {
    EngineOptions options;
    options.render.width_px = options.render.height_px = 128;
    options.render.model = ImageModel::paper;
    auto engine = ScanEngine::create(open.bundle, open.exercises[0], options);
    EXPECT_TRUE(engine);
    return std::move(*engine);
}

// Trembling hands: probe and needle about the middle of the skin, in `mannequin`.
TrackerReading reading_at(int i, testing::Random& random) {
    TrackerReading r;
    r.sequence = static_cast<std::uint64_t>(i) + 1;
    r.time_s = i / 40.0;
    r.in_mannequin = true;
    r.sensor_count = 2;
    const Vector3 shake{random.gaussian(), random.gaussian(), random.gaussian()};
    r.sensors[kProbeSensor].state = i == 30 ? SensorState::lost : SensorState::ok;
    r.sensors[kProbeSensor].world_from_sensor = {
        rotation_about({0, 1, 0}, 0.01 * random.gaussian()) *
            Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}),
        Vector3{0, 0, 59} + 0.3 * shake};
    const double depth = 0.6 * i - 15;
    const Vector3 z = normalized({-1, 0.02 * random.gaussian(), -1}),
                  x = normalized(cross({0, 1, 0}, z));
    const Point3 tip = Point3{40, 0, 45} + depth * z;
    r.sensors[kNeedleSensor].state = i < 5 || i == 50 ? SensorState::lost : SensorState::ok;
    r.sensors[kNeedleSensor].world_from_sensor = {Matrix3::from_columns(x, cross(z, x), z),
                                                  tip - Point3{}};
    return r;
}

TEST(SessionRun, AReplayGivesTheSamePixelsToTheLastBit) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "s.igs.mha";
    const auto open = small_open_case();
    std::vector<std::vector<std::uint8_t>> shown;
    std::vector<std::uint8_t> pixels(128 * 128);
    {
        ScanEngine engine = engine_of(*open);
        // What happened before the session must not matter.
        testing::Random random(1);
        for (int i = 0; i < 7; ++i) {
            engine.observe(reading_at(40 + i, random), false);
            engine.frame(100 + i, {}, pixels);
        }
        auto run = SessionRun::start(path, *open, engine, "Ada", utc_now(), 1234.5678);
        ASSERT_TRUE(run) << run.error().message();
        ImageSettings settings;
        testing::Random hands(2);
        for (int i = 0; i < 120; ++i) {
            if (i == 40) settings.gain_db = 1.0 / 3;
            if (i == 70) settings.tgc_db[2] = 2.1, settings.flip_left_right = true;
            engine.observe(reading_at(i, hands), false);
            engine.frame(1234.5678 + i / 40.0 + 1e-4 * i * i, settings, pixels);
            (*run)->observe(engine.last(), pixels, true);
            shown.push_back(pixels);
        }
        const auto score = (*run)->finish();
        ASSERT_TRUE(score) << score.error().message();
        EXPECT_EQ(score->value("insertions"), 1);
    }
    const auto recording = load_recording(path);
    ASSERT_TRUE(recording) << recording.error().message();
    const auto replay = session_replay(path);
    ASSERT_TRUE(replay);
    EXPECT_EQ(replay->header.trainee, "Ada");
    ReplayTracker tracker(*recording, false);
    ASSERT_EQ(tracker.recorded_readings(), 120);
    ScanEngine engine = engine_of(*open);
    ImageSettings settings;
    for (int i = 0; i < 120; ++i) {
        const double now_s = tracker.recorded_time_s(i);
        TrackerReading reading;
        if (tracker.poll(now_s, reading)) engine.observe(reading, false);
        apply_settings_text(replay->settings[i], settings);
        engine.frame(now_s, settings, pixels);
        ASSERT_EQ(pixels, shown[i]) << "frame " << i;
    }
}

// One insertion ends and one does not: the review can show where the needle was at its deepest in
// both.
TEST(SessionRun, KeepsThePictureOfEachInsertionsDeepestPoint) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "s.igs.mha";
    const auto open = small_open_case();
    ScanEngine engine = engine_of(*open);
    std::vector<std::uint8_t> pixels(128 * 128);
    std::map<double, std::vector<std::uint8_t>> shown;
    auto run = SessionRun::start(path, *open, engine, "", utc_now(), 0);
    ASSERT_TRUE(run) << run.error().message();
    testing::Random hands(2);
    // The tip goes to reading 80, out again to 0, and in to 60.
    const auto place = [](int i) { return i < 80 ? i : i < 160 ? 160 - i : i - 160; };
    for (int i = 0; i <= 220; ++i) {
        TrackerReading reading = reading_at(place(i), hands);
        reading.sequence = static_cast<std::uint64_t>(i) + 1;
        reading.time_s = i / 40.0;
        for (auto sensor : {kProbeSensor, kNeedleSensor})
            reading.sensors[sensor].state = SensorState::ok;
        engine.observe(reading, false);
        engine.frame(i / 40.0, {}, pixels);
        (*run)->observe(engine.last(), pixels, true);
        shown[engine.last().input.time_s] = pixels;
    }
    ASSERT_TRUE((*run)->finish());
    const auto kept = load_sequence(pictures_path(path));
    ASSERT_TRUE(kept) << kept.error().message();
    std::vector<double> deepest_s;
    for (std::size_t i = 0; i < kept->frames.size(); ++i) {
        const SequenceFrame& frame = kept->frames[i];
        if (i > 0) {
            EXPECT_LE(kept->frames[i - 1].timestamp_s, frame.timestamp_s);
        }
        if (frame.fields.front().value != "deepest") continue;
        deepest_s.push_back(frame.timestamp_s);
        const auto begin = kept->pixels.begin() + static_cast<std::ptrdiff_t>(i * 128 * 128);
        ASSERT_TRUE(shown.count(frame.timestamp_s));
        EXPECT_TRUE(std::equal(begin, begin + 128 * 128, shown[frame.timestamp_s].begin()));
    }
    ASSERT_EQ(deepest_s.size(), 2u);
    EXPECT_NEAR(deepest_s[0], 80 / 40.0, 2.5 / 40);  // 0.6 mm a reading, and kept each 0.5 mm
    EXPECT_NEAR(deepest_s[1], 220 / 40.0, 2.5 / 40);
}

// A cyst to be drained: numbed outside it, emptied, and the needle rests in it.
Exercise draining() {
    Exercise exercise = testing::small_exercise();
    exercise.targets[0] = {"cyst", {25, 0, 35}, 8, 8, TargetLook::cyst, "", {}, ""};
    Procedure& p = exercise.procedure;
    ProcedureStep numb, rest, empty;
    numb.name = "numb";
    numb.done.act = static_cast<int>(ActKind::inject);
    numb.done.at_least = 3;
    numb.done.tip_not_in = {"cyst"};
    rest.name = "rest";
    rest.done.needle_in = 1;
    rest.done.hold_s = 0.4;
    empty.name = "empty";
    empty.done.act = static_cast<int>(ActKind::drain);
    empty.done.drained_at_least = 0.5;
    p.steps = {numb, rest, empty};
    for (int i = 0; i < 3; ++i) {
        ProcedureItem item;
        item.name = p.steps[static_cast<std::size_t>(i)].name;
        item.step = i;
        p.items.push_back(item);
    }
    return exercise;
}

// The needle goes down to the cyst's middle in 2 s and stays there; 6 s at 40 readings a second.
TrackerReading draining_at(int i) {
    TrackerReading r;
    r.sequence = static_cast<std::uint64_t>(i) + 1;
    r.time_s = i / 40.0;
    r.in_mannequin = true;
    r.sensor_count = 2;
    r.sensors[kProbeSensor].state = SensorState::ok;
    r.sensors[kProbeSensor].world_from_sensor = {
        Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {0, 0, 59}};
    const double above_mm = std::max(0.0, 30 - 30.0 * i / 80);
    r.sensors[kNeedleSensor].state = SensorState::ok;
    r.sensors[kNeedleSensor].world_from_sensor = {
        Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {25, 0, 35 + above_mm}};
    if (i == 30) r.acts.add({ActKind::inject, 0, 1});
    if (i == 40) r.acts.add({ActKind::inject, 0, 2});
    if (i == 120) r.acts.add({ActKind::drain, 0, 1});
    if (i == 160) r.acts.add({ActKind::drain, 0, 0.4});
    return r;
}

TEST(SessionRun, AJumpInAReplayLeadsToTheStateOfPlayingIt) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "s.igs.mha";
    auto open = small_open_case();
    open->exercises = {draining()};
    std::vector<std::uint8_t> pixels(128 * 128);
    {
        ScanEngine engine = engine_of(*open);
        auto run = SessionRun::start(path, *open, engine, "", utc_now(), 0);
        ASSERT_TRUE(run) << run.error().message();
        for (int i = 0; i < 240; ++i) {
            engine.observe(draining_at(i), false);
            engine.frame(i / 40.0, {}, pixels);
            (*run)->observe(engine.last(), pixels, true);
        }
        ASSERT_TRUE((*run)->finish());
    }
    const auto recording = load_recording(path);
    ASSERT_TRUE(recording) << recording.error().message();
    // The replay runs on to from_s, jumps, and goes on to its end; at 40 pictures a second.
    const auto replay = [&](double from_s, double jump_s) {
        PacedTracker tracker(std::make_unique<ReplayTracker>(*recording, true));
        ScanEngine engine = engine_of(*open);
        bool jumped = false;
        for (int i = 0;; ++i) {
            const double now_s = 50 + i / 40.0;
            TrackerReading reading;
            if (!jumped && now_s - 50 >= from_s && jump_s != 0) {
                tracker.jump(jump_s);
                jumped = true;
            }
            if (tracker.poll(now_s, reading)) {
                engine.observe(reading, false);
                if (reading.restarts) engine.pass_over(tracker.passed_over());
            }
            engine.frame(now_s, {}, pixels);
            if ((jumped || jump_s == 0) && tracker.at_s() > 5.9) return engine.procedure();
            if (i > 2000) return engine.procedure();
        }
    };
    const ProcedureRun played = replay(0, 0);
    ASSERT_EQ(played.result().points, 3);
    ASSERT_NEAR(played.state().drained_ml, 1.4, 1e-9);
    struct Jump {
        double from_s, by_s;
    };
    // Over injections, over all of it, back before the first act, back between two drains.
    sonocase::testing::HardCase off("volume drained, after a jump off that of playing",
                                    sonocase::testing::HardCase::at_most, 0, "ml");
    for (const Jump jump : {Jump{0.2, 3.5}, {0.1, 5.5}, {4.5, -4.3}, {5, -1.5}}) {
        const ProcedureRun run = replay(jump.from_s, jump.by_s);
        EXPECT_EQ(run.state().injected_ml, played.state().injected_ml) << jump.by_s;
        off.see(std::abs(run.state().drained_ml - played.state().drained_ml));
        EXPECT_EQ(run.scene().target_scale[0], played.scene().target_scale[0]) << jump.by_s;
        EXPECT_EQ(run.state().pool_count, played.state().pool_count) << jump.by_s;
        const ProcedureResult list = run.result(), wanted = played.result();
        for (std::size_t i = 0; i < wanted.items.size(); ++i) {
            EXPECT_EQ(list.items[i].ticked, wanted.items[i].ticked) << jump.by_s;
            // Moments count from the recording's first reading.
            EXPECT_NEAR(list.items[i].time_s, wanted.items[i].time_s - 50, 0.026)
                << wanted.items[i].name << " " << jump.by_s;
        }
    }
}

// Draining, as an expert's script.
Sweep draining_script() {
    Sweep sweep;
    sweep.name = "expert";
    const auto key = [&](double time_s, Point3 tip, const std::vector<Act>& acts) {
        SweepKey k;
        k.time_s = time_s;
        k.probe = {0, 0, 59};
        k.beam = {0, 0, -1};
        k.lateral = {1, 0, 0};
        k.needle_tip = tip;
        k.needle_direction = {0, 0, -1};
        k.has_needle = true;
        for (const Act& act : acts) k.acts.add(act);
        sweep.keys.push_back(k);
    };
    key(0, {25, 0, 65}, {});
    key(1, {25, 0, 50}, {{ActKind::inject, 0, 3}});
    key(2, {25, 0, 35}, {});
    key(3, {25, 0, 35}, {{ActKind::drain, 0, 1}});
    key(4, {25, 0, 35}, {{ActKind::drain, 0, 0.4}});
    key(6, {25, 0, 35}, {});
    return sweep;
}

TEST(SessionRun, AJumpInAScriptLeadsToTheStateOfPlayingIt) {
    auto open = small_open_case();
    open->exercises = {draining()};
    std::vector<std::uint8_t> pixels(128 * 128);
    const Skin skin(*open->bundle);
    const auto play = [&](double from_s, double jump_s) {
        PacedTracker tracker(std::make_unique<ScriptedSweep>(draining_script(), skin, true));
        ScanEngine engine = engine_of(*open);
        bool jumped = jump_s == 0;
        for (int i = 0; i < 2000; ++i) {
            const double now_s = i / 40.0;
            if (!jumped && now_s >= from_s) {
                tracker.jump(jump_s);
                jumped = true;
            }
            TrackerReading reading;
            if (tracker.poll(now_s, reading)) {
                engine.observe(reading, false);
                if (reading.restarts) engine.pass_over(tracker.passed_over());
            }
            engine.frame(now_s, {}, pixels);
            if (jumped && tracker.at_s() > 5.9) break;
        }
        return engine.procedure();
    };
    const ProcedureRun played = play(0, 0);
    ASSERT_EQ(played.result().points, 3);
    ASSERT_NEAR(played.state().drained_ml, 1.4, 1e-9);
    struct Jump {
        double from_s, by_s;
    };
    for (const Jump jump : {Jump{0.2, 3.5}, {0.1, 5.5}, {4.5, -4.3}, {5, -1.5}}) {
        const ProcedureRun run = play(jump.from_s, jump.by_s);
        EXPECT_EQ(run.state().injected_ml, played.state().injected_ml) << jump.by_s;
        EXPECT_EQ(run.state().drained_ml, played.state().drained_ml) << jump.by_s;
        EXPECT_EQ(run.state().pool_count, played.state().pool_count) << jump.by_s;
        const ProcedureResult list = run.result(), wanted = played.result();
        for (std::size_t i = 0; i < wanted.items.size(); ++i) {
            EXPECT_EQ(list.items[i].ticked, wanted.items[i].ticked) << jump.by_s;
            EXPECT_NEAR(list.items[i].time_s, wanted.items[i].time_s, 0.041)  // a sample
                << wanted.items[i].name << " " << jump.by_s;
        }
        const Point3 pool = run.scene().pools[0].centre, was = played.scene().pools[0].centre;
        EXPECT_LT(norm(pool - was), 1) << jump.by_s;  // where the tip was, and not where it came to
    }
}

}  // namespace
}  // namespace sonocase::runtime
