// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <cmath>

#include "formats/recording/session.h"
#include "formats/recording/transform_log.h"
#include "support/random.h"

namespace sonocase {
namespace {

Session example() {
    testing::Random random(21);
    Session s;
    s.header = {.case_name = "demo",
                .case_digest = "00ff",
                .exercise = "liver biopsy",
                .exercise_digest = "11ee",
                .trainee = "Ada L.",
                .started = "2026-03-01T10:00:00Z",
                .program = "sonoplay 0.1.0",
                .render = "model=paper",
                .attempt = ""};
    for (int i = 0; i < 40; ++i) {
        SessionSample sample;
        sample.time_s = 0.05 * i;
        sample.frame = 3 * i;
        sample.probe_ok = i != 5;
        sample.needle_ok = i % 7 != 3;
        sample.mannequin_from_probe = random.rigid(200);
        sample.mannequin_from_needle = random.rigid(200);
        sample.mannequin_from_drawn = random.rigid(200);
        if (i == 9) sample.settings = "gain_db=3";
        s.samples.push_back(sample);
    }
    s.events = {{0.5, 30, "needle_entry", "insertion=1 depth_mm=2.5"},
                {0.52, 30, "target_hit", "target=0 name=lesion"},
                {1.95, 117, "session_end", ""}};
    return s;
}

// Each would be scored as zeros, or as somebody else's session, without a word.
TEST(SessionFile, SessionsThatNothingCanBeToldOfAreRefused) {
    EXPECT_TRUE(check_session(example(), "s"));
    Session twice = example(), back = example(), lost = example(), metres = example();
    twice.samples[4].time_s = twice.samples[3].time_s;
    EXPECT_TRUE(check_session(twice, "s"));
    for (const double time : {0.01, std::nan("")}) {
        back.samples[7].time_s = time;
        const Status status = check_session(back, "s");
        ASSERT_FALSE(status);
        EXPECT_NE(status.error().what.find("do not rise at frame 8"), std::string::npos);
    }
    for (SessionSample& sample : lost.samples) sample.probe_ok = sample.needle_ok = false;
    const Status none = check_session(lost, "s");
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().what.find("none of 40 frames"), std::string::npos);
    for (SessionSample& sample : metres.samples)
        for (Rigid* pose : {&sample.mannequin_from_probe, &sample.mannequin_from_needle})
            pose->translation = 0.001 * pose->translation;
    const Status small = check_session(metres, "s");
    ASSERT_FALSE(small);
    EXPECT_NE(small.error().expected.find("metres"), std::string::npos);
    EXPECT_TRUE(check_session({}, "s"));  // an empty one has an error of its own
}

TEST(SessionFile, ComesBackAsItWas) {
    Session s = example();
    s.samples.back().unseen = true;
    const auto bytes = write_sequence(sequence_from_session(s), SequenceForm::mha);
    const auto sequence = read_sequence(bytes, "s");
    ASSERT_TRUE(sequence) << sequence.error().message();
    const auto back = session_from_sequence(*sequence, guess_names(*sequence), "s");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->header.trainee, "Ada L.");
    EXPECT_EQ(back->header.exercise, "liver biopsy");
    EXPECT_EQ(back->header.render, "model=paper");
    ASSERT_EQ(back->samples.size(), s.samples.size());
    for (std::size_t i = 0; i < s.samples.size(); ++i) {
        const SessionSample &a = back->samples[i], &b = s.samples[i];
        EXPECT_EQ(std::tie(a.time_s, a.frame, a.probe_ok, a.needle_ok, a.settings, a.unseen),
                  std::tie(b.time_s, b.frame, b.probe_ok, b.needle_ok, b.settings, b.unseen));
        if (b.probe_ok) {
            EXPECT_EQ(a.mannequin_from_probe, b.mannequin_from_probe);
        }
        if (b.needle_ok) {
            EXPECT_EQ(a.mannequin_from_needle, b.mannequin_from_needle);
            EXPECT_EQ(a.mannequin_from_drawn, b.mannequin_from_drawn);
        }
    }
    ASSERT_EQ(back->events.size(), 3u);
    EXPECT_EQ(back->events[0], s.events[0]);
    EXPECT_EQ(back->events[1].time_s, 0.52);
    EXPECT_EQ(back->events[1].name, "target_hit");
    EXPECT_EQ(detail_value(back->events[1].detail, "name"), "lesion");
    EXPECT_EQ(back->events[2].name, "session_end");
}

TEST(SessionFile, ATransformThatIsNotThereIsNamedWithThoseThatAre) {
    const Sequence sequence = sequence_from_session(example());
    SessionNames names;
    names.needle = "StylusToRAS";
    const auto s = session_from_sequence(sequence, names, "s");
    ASSERT_FALSE(s);
    EXPECT_NE(s.error().message().find("StylusToRAS"), std::string::npos);
    EXPECT_NE(s.error().message().find("ProbeToMannequin"), std::string::npos);
}

TEST(SessionFile, OtherPeoplesNamesAreGuessedAndTheAxisTurned) {
    Sequence sequence;
    sequence.transforms = {"ReferenceToTracker", "ProbeToReference", "NeedleTipToReference"};
    SequenceFrame frame;
    frame.poses.resize(3);
    frame.poses[2].ok = true;
    sequence.frames = {frame};
    SessionNames names = guess_names(sequence);
    EXPECT_EQ(names.probe, "ProbeToReference");
    EXPECT_EQ(names.needle, "NeedleTipToReference");
    names.needle_axis = {0, -1, 0};
    const auto s = session_from_sequence(sequence, names, "s");
    ASSERT_TRUE(s) << s.error().message();
    EXPECT_NEAR(s->samples[0].mannequin_from_needle.rotation.column(2).y, -1, 1e-15);
    EXPECT_NEAR(determinant(s->samples[0].mannequin_from_needle.rotation), 1, 1e-15);
}

TEST(SessionFile, DetailWordsAreFoundWhole) {
    EXPECT_EQ(detail_value("a=1 ab=2 b=3", "b"), "3");
    EXPECT_EQ(detail_value("a=1 ab=2 b=3", "ab"), "2");
    EXPECT_EQ(detail_value("a=1", "c"), "");
    EXPECT_EQ(detail_value("", "a"), "");
}

TEST(TransformLog, ReadsTheToolsInTurn) {
    const std::string xml =
        "<TransformRecorderLog>\n"
        "  <log TimeStampSec=\"7\" TimeStampNSec=\"256000000\" type=\"transform\" "
        "DeviceName=\"ProbeToRAS\" "
        "transform=\"1 0 0 10 0 1 0 20 0 0 1 30 0 0 0 1 \" />\n"
        "  <log TimeStampSec=\"7\" TimeStampNSec=\"283000000\" type=\"transform\" "
        "DeviceName=\"StylusTipToRAS\" "
        "transform=\"0 1 0 1 1 0 0 2 0 0 -1 3 0 0 0 1 \" />\n"
        "  <log TimeStampSec=\"8\" TimeStampNSec=\"0\" type=\"message\" message=\"start\" />\n"
        "</TransformRecorderLog>\n";
    EXPECT_TRUE(looks_like_transform_log(xml));
    const auto log = parse_transform_log(xml, "log.xml");
    ASSERT_TRUE(log) << log.error().message();
    ASSERT_EQ(log->frames.size(), 2u);
    EXPECT_EQ(log->frames[0].timestamp_s, 7.256);
    EXPECT_TRUE(log->frames[0].poses[0].ok);
    EXPECT_FALSE(log->frames[0].poses[1].ok);
    EXPECT_EQ(log->frames[1].poses[1].to_from[11], 3);
    const auto session = session_from_sequence(*log, guess_names(*log), "log.xml");
    ASSERT_TRUE(session) << session.error().message();
    EXPECT_EQ(session->events.size(), 1u);
    std::string lost = xml;
    lost.replace(lost.find("1 0 0 10"), 8, "-1.#IND 0 0 10");
    EXPECT_TRUE(parse_transform_log(lost, "log.xml"));
    for (std::size_t n = 0; n < xml.size(); ++n) (void)parse_transform_log(xml.substr(0, n), "cut");
    EXPECT_FALSE(parse_transform_log("<TransformRecorderLog/>", "empty"));
}

}  // namespace
}  // namespace sonocase
