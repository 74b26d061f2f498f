// SPDX-License-Identifier: Apache-2.0

// Scores of colour and spectral Doppler, from what a recording says of each frame.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"

namespace sonocase {
namespace {

Exercise for_vessels(std::initializer_list<const char*> labels) {
    Exercise exercise;
    for (const char* label : labels) {
        Target target;
        target.inside = label;
        exercise.targets.push_back(target);
    }
    return exercise;
}

// Samples 0.1 s apart, all alike.
void add(Session& session, int count, const DopplerSample& doppler) {
    for (int n = 0; n < count; ++n) {
        SessionSample sample;
        sample.frame = static_cast<std::int64_t>(session.samples.size());
        sample.time_s = 0.1 * static_cast<double>(sample.frame);
        sample.has_doppler = true;
        sample.doppler = doppler;
        session.samples.push_back(sample);
    }
}

double score(const Session& session, const Exercise& exercise, const char* name) {
    return score_session(session, exercise, nullptr, {}).value(name);
}

DopplerSample gate_in(const char* vessel, double psv, double angle = 52, double cursor = 50) {
    DopplerSample d;
    d.gate = vessel;
    d.gate_fill = 0.8;
    d.angle_deg = angle;
    d.cursor_deg = cursor;
    d.psv_cm_s = psv;
    d.true_psv_cm_s = 80;
    d.beats = 3;
    return d;
}

TEST(DopplerScore, AVesselCountsAsShownAfterASecondOfColour) {
    const Exercise exercise = for_vessels({"femoral_artery", "femoral_vein"});
    Session session;
    DopplerSample both;
    both.coloured = {"femoral_artery", "femoral_vein"};
    DopplerSample one;
    one.coloured = {"femoral_vein"};
    add(session, 6, both);
    EXPECT_EQ(score(session, exercise, "vessels_shown_in_colour"), 0);
    add(session, 8, one);
    EXPECT_EQ(score(session, exercise, "vessels_shown_in_colour"), 1);
    add(session, 8, both);
    EXPECT_EQ(score(session, exercise, "vessels_shown_in_colour"), 2);
    EXPECT_TRUE(std::isnan(score(session, exercise, "gate_in_vessel_fraction")));
}

TEST(DopplerScore, TheLastMeasurementOfEachVesselCounts) {
    const Exercise exercise = for_vessels({"femoral_artery"});
    Session session;
    add(session, 5, gate_in("femoral_artery", 120));
    add(session, 5, gate_in("femoral_artery", 84, 58, 61));
    EXPECT_EQ(score(session, exercise, "vessels_measured"), 1);
    EXPECT_EQ(score(session, exercise, "correct_vessel_measured"), 1);
    EXPECT_NEAR(score(session, exercise, "peak_velocity_error_percent"), 5, 1e-9);
    EXPECT_NEAR(score(session, exercise, "doppler_angle_max_deg"), 58, 1e-9);
    EXPECT_NEAR(score(session, exercise, "angle_cursor_error_deg"), 3, 1e-9);
    EXPECT_NEAR(score(session, exercise, "gate_in_vessel_fraction"), 0.8, 1e-9);
    // Measured in another vessel as well: the right one still counts, and the wrong one is told.
    add(session, 10, gate_in("femoral_vein", 20));
    EXPECT_EQ(score(session, exercise, "correct_vessel_measured"), 0);
    EXPECT_NEAR(score(session, exercise, "gate_in_vessel_fraction"), 0.8 * 9 / 19, 1e-9);
}

TEST(DopplerScore, ABeatIsNotEnoughAndWithoutDopplerNothingIsDefined) {
    const Exercise exercise = for_vessels({"femoral_artery"});
    Session session;
    DopplerSample short_look = gate_in("femoral_artery", 80);
    short_look.beats = 1;
    add(session, 5, short_look);
    EXPECT_EQ(score(session, exercise, "vessels_measured"), 0);
    EXPECT_TRUE(std::isnan(score(session, exercise, "peak_velocity_error_percent")));
    Session grey;
    grey.samples.resize(3);
    EXPECT_TRUE(std::isnan(score(grey, exercise, "vessels_shown_in_colour")));
}

TEST(DopplerScore, WhatWasShownComesBackFromAFile) {
    Session session;
    session.header.case_name = "vessels";
    add(session, 1, gate_in("femoral_artery", 84));
    DopplerSample colour;
    colour.coloured = {"femoral_artery", "femoral_vein"};
    add(session, 1, colour);
    add(session, 1, {});  // a mode is on and shows nothing
    const auto bytes = write_sequence(sequence_from_session(session), SequenceForm::mha);
    const auto sequence = read_sequence(bytes, "session");
    ASSERT_TRUE(sequence) << sequence.error().message();
    const auto back = session_from_sequence(*sequence, {}, "session");
    ASSERT_TRUE(back) << back.error().message();
    ASSERT_EQ(back->samples.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_TRUE(back->samples[i].has_doppler);
        EXPECT_EQ(back->samples[i].doppler, session.samples[i].doppler) << i;
    }
}

}  // namespace
}  // namespace sonocase
