// SPDX-License-Identifier: Apache-2.0

// One recording in every form: the same scores, calibration and replay.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/calibration/point.h"
#include "formats/files/load_save.h"
#include "formats/scoring/session_score.h"
#include "runtime/tracking/replay_tracker.h"
#include "support/recording_forms.h"

namespace sonocase::runtime {
namespace {

// A probe that slides, and a needle that pivots about its tip; the needle is lost in every seventh.
std::pair<std::vector<Pose>, std::vector<Pose>> attempt() {
    sonocase::testing::Random random(21);
    const Vector3 tip{5, -3, -120};
    std::vector<Pose> probe, needle;
    for (int i = 0; i < 400; ++i) {
        const double t = 0.05 * i;
        const auto noise = [&] { return random.uniform(-0.05, 0.05); };
        const Matrix3 turn =
            rotation_about({std::cos(0.7 * t), std::sin(0.7 * t), 0}, 0.5 * std::sin(0.31 * t)) *
            rotation_about({0, 0, 1}, 0.9 * std::sin(0.2 * t));
        const Vector3 hand = Vector3{40, 20, 300} - turn * tip;
        probe.push_back({i, t, true,
                         Rigid{rotation_about({1, 0, 0}, 3 + noise()),
                               {60 * std::sin(t) + noise(), 30 * std::cos(0.4 * t), 100}}});
        needle.push_back(
            {i, t, i % 7 != 6, Rigid{turn, hand + Vector3{noise(), noise(), noise()}}});
    }
    return {probe, needle};
}

TEST(RecordingForms, GiveTheSameScoresCalibrationAndReplay) {
    const auto [probe, needle] = attempt();
    const sonocase::testing::TemporaryFolder folder;
    const std::vector<std::string> forms =
        sonocase::testing::write_recording_forms(folder, probe, needle);
    ASSERT_GE(forms.size(), 8u);
    SessionScore first_score;
    PointFit first_fit;
    Exercise exercise;
    exercise.kind = "biopsy";
    for (const std::string& form : forms) {
        const auto sequence = load_recording_file(form);
        ASSERT_TRUE(sequence) << sequence.error().message();
        const SessionNames names = guess_names(*sequence);
        const auto session = session_from_sequence(*sequence, names, form);
        ASSERT_TRUE(session) << session.error().message();
        ASSERT_TRUE(check_session(*session, form));
        const SessionScore score = score_session(*session, exercise, nullptr, {}, {});
        const PointFit fit =
            fit_point(poses_of(*sequence, sequence->transform_index(names.needle)), {});
        ASSERT_TRUE(fit.determined) << form << ": " << fit.problem;
        EXPECT_LT(norm(fit.tip_mm - Vector3{5, -3, -120}), 0.1);
        if (&form == &forms.front()) {
            first_score = score;
            first_fit = fit;
            ASSERT_GT(score.value("needle_path_length_mm") + score.value("probe_path_length_mm"),
                      0);
        }
        ASSERT_EQ(score.metrics.size(), first_score.metrics.size()) << form;
        for (std::size_t i = 0; i < score.metrics.size(); ++i) {
            const double a = score.metrics[i].value, b = first_score.metrics[i].value;
            if (std::isnan(a) && std::isnan(b)) continue;
            EXPECT_NEAR(a, b, 1e-9 * std::max(1.0, std::abs(b)))
                << form << " " << score.metrics[i].name;
        }
        EXPECT_LT(norm(fit.tip_mm - first_fit.tip_mm), 1e-9) << form;
        const auto replayed = load_recording(form);
        ASSERT_TRUE(replayed) << replayed.error().message();
        ReplayTracker tracker(*replayed, false);
        ASSERT_EQ(tracker.recorded_readings(), static_cast<int>(probe.size())) << form;
        TrackerReading reading;
        for (std::size_t i = 0; i < probe.size(); ++i) {
            ASSERT_TRUE(tracker.poll(tracker.recorded_time_s(static_cast<int>(i)), reading));
            const SensorReading &p = reading.sensors[kProbeSensor],
                                &n = reading.sensors[kNeedleSensor];
            ASSERT_EQ(p.state, SensorState::ok);
            EXPECT_LT(
                norm(p.world_from_sensor.translation - probe[i].tracker_from_tool.translation),
                1e-9)
                << form;
            // A log has no readings of what was lost: the neighbour's, half a step away, stands in.
            if (n.state != SensorState::ok || !needle[i].ok) continue;
            EXPECT_LT(
                norm(n.world_from_sensor.translation - needle[i].tracker_from_tool.translation),
                1e-9)
                << form << " " << i;
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
