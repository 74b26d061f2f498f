// SPDX-License-Identifier: Apache-2.0

// Scores of pressing, from recorded force and events.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/scoring/session_score.h"

namespace sonocase {
namespace {

// One sample per 0.1 s with the given forces and openings of the vein.
Session pressed_session(const std::vector<double>& force_n, const std::vector<double>& open = {}) {
    Session session;
    for (std::size_t n = 0; n < force_n.size(); ++n) {
        SessionSample sample;
        sample.time_s = 0.1 * static_cast<double>(n);
        sample.frame = static_cast<std::int64_t>(n);
        sample.probe_ok = sample.needle_ok = sample.has_press = true;
        sample.press.force_n = force_n[n];
        sample.press.pressure_kpa = 2 * force_n[n];
        if (!open.empty()) sample.press.vein_open = open[n];
        session.samples.push_back(sample);
    }
    return session;
}

TEST(PressScore, MeansAreOverTheTimeOfPressing) {
    Exercise exercise;
    exercise.deformation.force_limit_n = 5;
    const SessionScore score =
        score_session(pressed_session({0, 0, 4, 4, 8, 8, 0}), exercise, nullptr, {});
    EXPECT_NEAR(score.value("probe_force_mean_n"), 6, 1e-12);
    EXPECT_NEAR(score.value("probe_pressure_mean_kpa"), 12, 1e-12);
    EXPECT_EQ(score.value("probe_force_max_n"), 8);
    EXPECT_NEAR(score.value("press_time_over_limit_s"), 0.2, 1e-12);
    EXPECT_EQ(score.value("compressions_done"), 0);
    EXPECT_TRUE(std::isnan(score.value("vein_collapse_at_puncture_percent")));
}

TEST(PressScore, ACompressionIsAVeinShutAndOpenedAgain) {
    const std::vector<double> force{0, 5, 9, 5, 2, 9, 0, 9};
    const std::vector<double> open{-1, 0.6, 0.05, 0.3, 0.7, 0.08, -1, 0.02};
    EXPECT_EQ(
        score_session(pressed_session(force, open), {}, nullptr, {}).value("compressions_done"), 2);
    // A thrombosed vein does not drain: nothing is shut.
    EXPECT_EQ(score_session(pressed_session(force), {}, nullptr, {}).value("compressions_done"), 0);
}

TEST(PressScore, TheFirstVesselCounts) {
    Session session = pressed_session({6, 6, 6}, {1, 0.25, 0.2});
    session.events = {{0.1, 1, "tissue_puncture", "label=muscle force_n=0.1"},
                      {0.1, 1, "tissue_puncture", "label=femoral_vein force_n=0.4"},
                      {0.2, 2, "posterior_wall", "label=femoral_vein force_n=0.4"}};
    Exercise exercise;
    Target target;
    target.inside = "femoral_vein";
    exercise.targets = {target};
    SessionScore score = score_session(session, exercise, nullptr, {});
    EXPECT_NEAR(score.value("vein_collapse_at_puncture_percent"), 75, 1e-12);
    EXPECT_EQ(score.value("posterior_wall_punctures"), 1);
    EXPECT_EQ(score.value("correct_vessel_punctured"), 1);
    session.events[1].detail = "label=femoral_artery force_n=0.8";
    score = score_session(session, exercise, nullptr, {});
    EXPECT_EQ(score.value("correct_vessel_punctured"), 0);
    EXPECT_TRUE(std::isnan(score.value("vein_collapse_at_puncture_percent")));
}

TEST(PressScore, RecordingsOfBeforeHaveNone) {
    Session session = pressed_session({1, 2});
    for (SessionSample& sample : session.samples) sample.has_press = false;
    const SessionScore score = score_session(session, {}, nullptr, {});
    for (const char* name : {"probe_force_max_n", "compressions_done", "posterior_wall_punctures"})
        EXPECT_TRUE(std::isnan(score.value(name))) << name;
}

TEST(PressScore, ForceGoesThroughASequenceAndBack) {
    const Session session = pressed_session({0, 3.25}, {-1, 0.5});
    const auto back = session_from_sequence(sequence_from_session(session), {}, "memory");
    ASSERT_TRUE(back.has_value());
    for (std::size_t n = 0; n < 2; ++n) {
        EXPECT_TRUE(back->samples[n].has_press);
        EXPECT_EQ(back->samples[n].press.force_n, session.samples[n].press.force_n);
        EXPECT_EQ(back->samples[n].press.vein_open, session.samples[n].press.vein_open);
    }
}

}  // namespace
}  // namespace sonocase
