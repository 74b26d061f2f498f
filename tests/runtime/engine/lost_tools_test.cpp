// SPDX-License-Identifier: Apache-2.0

// A thousand random drop-outs of a tool in each of the ways in which senders say so, or say
// nothing.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/scoring/tool_track.h"
#include "runtime/engine/scan_engine.h"
#include "support/random.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

TEST(LostTools, GapAndPathAreTheTrueOnesInEveryWayOfLosingATool) {
    enum Way { silent, said, not_a_number, at_identity, repeated, kWays };
    constexpr int kDrops = 1000;
    constexpr double kStep = 1 / 30.0;
    CaseBundle bundle = sonocase::testing::small_case();
    EngineOptions options;
    options.render.model = ImageModel::paper;
    options.render.width_px = options.render.height_px = 16;
    options.render.scanlines = 8;
    options.render.samples = 16;
    for (int way = 0; way < kWays; ++way) {
        auto engine = ScanEngine::create(bundle, sonocase::testing::small_exercise(), options);
        ASSERT_TRUE(engine) << engine.error().message();
        sonocase::testing::Random random(43 + static_cast<std::uint64_t>(way));
        TrackerReading reading;
        reading.sensor_count = 2;
        double t = 0, path_mm = 0, worst_s = 0;
        int wrong = 0, late = 0;
        const auto noise = [&] { return random.uniform(-0.05, 0.05); };
        Session session;
        Vector3 last{};
        const auto step = [&](bool seen) {
            t += kStep;
            reading.time_s = t;
            SensorReading &probe = reading.sensors[0], &needle = reading.sensors[1];
            probe.state = SensorState::ok;
            probe.time_s = t;
            probe.world_from_sensor.translation = {noise(), 5 * std::sin(t) + noise(), 59};
            if (seen || way != silent) needle.time_s = t;
            if (seen) {
                needle.state = SensorState::ok;
                // The hand moves at 12 mm/s; what it did unseen is no part of the path.
                needle.world_from_sensor = Rigid{
                    {}, {20 + 17 * std::sin(0.7 * t) + noise(), 10 * std::cos(t) + noise(), 80}};
            } else if (way == said) {
                needle.state = SensorState::lost;
                needle.world_from_sensor.translation = {noise(), 0, 0};
            } else if (way == not_a_number) {
                needle.world_from_sensor.translation.x = NAN;
            } else if (way == at_identity) {
                needle.world_from_sensor = {};
            }
            engine->observe(reading, true);
            const SensorVerdict verdict = engine->needle_verdict(t);
            SessionSample sample;
            sample.time_s = t;
            sample.needle_ok = verdict != SensorVerdict::lost && verdict != SensorVerdict::stale &&
                               verdict != SensorVerdict::absent;
            if (sample.needle_ok) sample.needle_age_s = engine->needle_age_s(t);
            // While it is held in doubt the last true pose is shown.
            if (seen) last = needle.world_from_sensor.translation;
            sample.mannequin_from_needle.translation = last;
            session.samples.push_back(sample);
            return sample.needle_ok;
        };
        for (int drop = 0; drop < kDrops; ++drop) {
            session.samples.clear();
            const double seen_s = random.uniform(1, 2), lost_s = random.uniform(0.4, 5);
            Session truth;
            for (const double end = t + seen_s; t < end;) {
                wrong += !step(true);
                truth.samples.push_back(session.samples.back());
            }
            const double from = t;
            for (const double end = t + lost_s; t < end;) {
                const bool shown = step(false);
                if (shown && t - from > 0.3) ++late;
                truth.samples.push_back(session.samples.back());
                truth.samples.back().needle_ok = false;
            }
            const double to = t + kStep;
            for (int i = 0; i < 4; ++i) {
                step(true);
                truth.samples.push_back(session.samples.back());
                truth.samples.back().needle_ok = true;
            }
            const ToolTrack track = track_of(session, Tool::needle),
                            true_track = track_of(truth, Tool::needle);
            worst_s = std::max(worst_s, std::abs(track.longest_gap_s - (to - from)));
            const double got = motion_metrics(track.points).path_length_mm,
                         wanted = motion_metrics(true_track.points).path_length_mm;
            path_mm = std::max(path_mm, std::abs(got - wanted));
        }
        EXPECT_EQ(wrong, 0) << "a seen tool counted as lost, way " << way;
        EXPECT_EQ(late, 0) << "a lost tool was shown, way " << way;
        EXPECT_LE(worst_s, 0.05) << "way " << way;
        // The last shown pose is repeated until the tool is known to be lost: no path of its own.
        EXPECT_LE(path_mm, 1e-9) << "way " << way;
    }
}

}  // namespace
}  // namespace sonocase::runtime
