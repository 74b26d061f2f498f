// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/session_run.h"

#include <gtest/gtest.h>

#include "runtime/player/session/clock.h"
#include "runtime/recording/session_words.h"
#include "runtime/tracking/replay_tracker.h"
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

}  // namespace
}  // namespace sonocase::runtime
