// SPDX-License-Identifier: Apache-2.0

// The procedures of the demonstration: their experts pass them, and who bluffs at a step fails
// that step's item and no other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/procedure_run.h"
#include "pipeline/procedures/torso_anatomy.h"
#include "support/paths.h"

namespace sonocase {
namespace {

const testing::TorsoAnatomy& torso() {
    static const testing::TorsoAnatomy anatomy;
    return anatomy;
}

Exercise procedure_called(const std::string& name) {
    const std::string path = SONOCASE_SOURCE "/scenarios/procedures/" + name + ".toml";
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    std::string toml = text.str();
    const std::string frame = "frame = \"ct\"";  // the torso is in that frame as it stands
    toml.replace(toml.find(frame), frame.size(), std::string(frame.size(), ' '));
    auto exercise = parse_exercise(toml, path);
    EXPECT_TRUE(exercise) << exercise.error().message();
    return exercise ? *exercise : Exercise{};
}

const std::vector<std::string>& procedures() {
    static const std::vector<std::string> names{"liver-biopsy", "renal-biopsy", "abscess-drainage",
                                                "nephrostomy", "fast"};
    return names;
}

Rigid along(Point3 origin, Vector3 z, Vector3 x) {
    z = normalized(z);
    x = normalized(x - dot(x, z) * z);
    return {Matrix3::from_columns(x, cross(z, x), z), origin - Point3{}};
}

// The script at 20 samples per second, straight from key to key.
Session play(const Sweep& sweep) {
    constexpr double kTickS = 0.05;
    Session session;
    std::size_t at = 0;
    for (int i = 0; i * kTickS <= sweep.keys.back().time_s; ++i) {
        const double t = i * kTickS;
        SessionSample sample;
        sample.time_s = t;
        sample.frame = i;
        while (at < sweep.keys.size() && sweep.keys[at].time_s <= t) {
            const ActList& acts = sweep.keys[at].acts;
            for (int a = 0; a < acts.count; ++a) sample.acts.add(acts.acts[a]);
            ++at;
        }
        const SweepKey& from = sweep.keys[std::max<std::size_t>(at, 1) - 1];
        const SweepKey& to = sweep.keys[std::min(at, sweep.keys.size() - 1)];
        const double span = to.time_s - from.time_s;
        const double u = span > 0 ? (t - from.time_s) / span : 0;
        const auto mix = [&](Vector3 a, Vector3 b) { return (1 - u) * a + u * b; };
        sample.probe_ok = true;
        sample.mannequin_from_probe = along(from.probe + u * (to.probe - from.probe),
                                            mix(from.beam, to.beam), mix(from.lateral, to.lateral));
        sample.needle_ok = from.has_needle && to.has_needle;
        if (sample.needle_ok) {
            const Vector3 z = mix(from.needle_direction, to.needle_direction);
            sample.mannequin_from_drawn = sample.mannequin_from_needle =
                along(from.needle_tip + u * (to.needle_tip - from.needle_tip), z,
                      any_perpendicular(normalized(z)));
        }
        session.samples.push_back(sample);
    }
    return session;
}

const Sweep& expert_of(const Exercise& exercise) {
    for (const Sweep& sweep : exercise.sweeps)
        if (sweep.name == "expert") return sweep;
    ADD_FAILURE() << exercise.name << " has no expert";
    return exercise.sweeps.front();
}

ProcedureResult judge(const Session& session, const Exercise& exercise) {
    return *procedure_result(session, exercise, &torso(), torso().labels());
}

// "core-taken too_early" of each item that is not ticked.
std::vector<std::string> missed(const ProcedureResult& result) {
    std::vector<std::string> names;
    for (const ProcedureResult::Item& item : result.items)
        if (!item.ticked) names.push_back(item.name + " " + item.why);
    return names;
}

std::string joined(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
}

// The name of the item that the step ticks.
std::string item_of(const Exercise& exercise, int step) {
    for (const ProcedureItem& item : exercise.procedure.items)
        if (item.rule == ItemRule::step && item.step == step) return item.name;
    return {};
}

// What went missing because of step s alone: steps over a wire cannot be done without one, and
// their items go with that of the wire.
std::vector<std::string> missed_by(const Exercise& exercise, int s, const ProcedureResult& result) {
    std::vector<std::string> names = missed(result);
    const auto& steps = exercise.procedure.steps;
    if (steps[s].done.act != static_cast<int>(ActKind::wire)) return names;
    for (std::size_t other = 0; other < steps.size(); ++other) {
        if (steps[other].done.wire_in != 1) continue;
        const std::string lost = item_of(exercise, static_cast<int>(other)) + " not_done";
        EXPECT_EQ(std::erase(names, lost), 1u) << lost;
    }
    return names;
}

// Takes the acts of a kind out of a session.
ActList take(Session& session, ActKind kind) {
    ActList taken;
    for (SessionSample& sample : session.samples) {
        ActList rest;
        for (int i = 0; i < sample.acts.count; ++i)
            (sample.acts.acts[i].kind == kind ? taken : rest).add(sample.acts.acts[i]);
        sample.acts = rest;
    }
    return taken;
}

TEST(Procedures, TheExpertPassesEachWithEveryItem) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const ProcedureResult result = judge(play(expert_of(exercise)), exercise);
        EXPECT_TRUE(result.passed) << name;
        EXPECT_EQ(joined(missed(result)), "") << name;
        EXPECT_EQ(result.points, result.max_points) << name;
        EXPECT_TRUE(result.complications.empty()) << name;
        for (std::size_t i = 1; i < result.steps.size(); ++i)
            EXPECT_TRUE(!exercise.procedure.steps[i].group.empty() ||
                        result.steps[i].time_s > result.steps[i - 1].time_s)
                << name << ", step " << i;
    }
}

TEST(Procedures, WhoSkipsAnActFailsItsItemAlone) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        for (int s = 0; s < static_cast<int>(exercise.procedure.steps.size()); ++s) {
            const Condition& done = exercise.procedure.steps[s].done;
            if (done.act < 0) continue;
            Session session = play(expert_of(exercise));
            take(session, static_cast<ActKind>(done.act));
            const ProcedureResult result = judge(session, exercise);
            EXPECT_EQ(joined(missed_by(exercise, s, result)), item_of(exercise, s) + " not_done")
                << name;
        }
    }
}

TEST(Procedures, WhoActsInTheWrongPlaceOrTooEarlyFailsTheItemAlone) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        for (int s = 0; s < static_cast<int>(exercise.procedure.steps.size()); ++s) {
            const Condition& done = exercise.procedure.steps[s].done;
            if (done.act < 0) continue;
            Session session = play(expert_of(exercise));
            const ActList acts = take(session, static_cast<ActKind>(done.act));
            // Before anything has been looked at, and with nothing in the body.
            for (int i = 0; i < acts.count; ++i) session.samples[1 + i].acts.add(acts.acts[i]);
            const ProcedureResult result = judge(session, exercise);
            const std::vector<std::string> lost = missed_by(exercise, s, result);
            ASSERT_EQ(lost.size(), 1u) << name << ": " << joined(lost);
            EXPECT_EQ(lost[0].find(item_of(exercise, s)), 0u) << lost[0];
        }
    }
}

TEST(Procedures, WhoActsTooLateFailsTheItemAlone) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const int last = static_cast<int>(exercise.procedure.steps.size()) - 1;
        for (int s = 0; s < last; ++s) {
            const Condition& done = exercise.procedure.steps[s].done;
            if (done.act < 0) continue;
            Session session = play(expert_of(exercise));
            const ActList acts = take(session, static_cast<ActKind>(done.act));
            const std::size_t end = session.samples.size();
            for (int i = 0; i < acts.count; ++i)
                session.samples[end - 6 + i].acts.add(acts.acts[i]);
            const ProcedureResult result = judge(session, exercise);
            const std::vector<std::string> lost = missed_by(exercise, s, result);
            ASSERT_EQ(lost.size(), 1u) << name << ": " << joined(lost);
            EXPECT_EQ(lost[0].find(item_of(exercise, s)), 0u) << lost[0];
        }
    }
}

TEST(Procedures, WhoLooksAwayWhileAPictureIsAskedForFailsThatItemAlone) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const Session expert = play(expert_of(exercise));
        const ProcedureResult whole = judge(expert, exercise);
        for (int s = 0; s < static_cast<int>(exercise.procedure.steps.size()); ++s) {
            const ProcedureStep& step = exercise.procedure.steps[s];
            if (step.done.act >= 0 || step.done.shows.empty()) continue;
            // Everything before the next step is hidden, so that the look comes too late; of one
            // group only the seconds that count, since the pose is not taken up again.
            const double end_s =
                step.group.empty() ? whole.steps[s + 1].time_s : whole.steps[s].time_s;
            Session session = expert;
            for (SessionSample& sample : session.samples) {
                const bool here = step.group.empty() ? sample.time_s <= end_s
                                                     : std::abs(sample.time_s - end_s) < 5;
                if (here) sample.probe_ok = false;
            }
            const ProcedureResult result = judge(session, exercise);
            std::vector<std::string> lost = missed(result);
            // Of a window that was never shown nobody is asked what it showed.
            const auto unasked = [](const std::string& one) {
                return one.find("reads-") == 0 && one.find(" not_answered") != std::string::npos;
            };
            if (!step.group.empty()) {
                EXPECT_EQ(std::count_if(lost.begin(), lost.end(), unasked), 1) << joined(lost);
                lost.erase(std::remove_if(lost.begin(), lost.end(), unasked), lost.end());
            }
            ASSERT_EQ(lost.size(), 1u) << name << ": " << joined(lost);
            EXPECT_EQ(lost[0].find(item_of(exercise, s)), 0u) << lost[0];
        }
    }
}

TEST(Procedures, AThousandRandomSessionsNeitherCrashNorPass) {
    RandomStream random(2027);
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const Session expert = play(expert_of(exercise));
        for (int run = 0; run < 1000 / static_cast<int>(procedures().size()) + 1; ++run) {
            ProcedureRun machine(exercise,
                                 std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), &torso()),
                                 torso().labels());
            double time_s = 0;
            for (int i = 0; i < 60; ++i) {
                // Poses of the expert in any order, and acts of any kind and amount.
                SessionSample sample = expert.samples[random.below(expert.samples.size())];
                sample.time_s = time_s += random.unit() < 0.05 ? 3 : 0.2;
                sample.acts = {};
                const int acts = static_cast<int>(random.below(5));
                for (int a = 0; a < acts; ++a)
                    sample.acts.add({static_cast<ActKind>(random.below(kActKinds)),
                                     static_cast<int>(random.below(12)),
                                     random.unit() < 0.02 ? NAN : random.uniform(-8, 32)});
                machine.update(sample);
            }
            EXPECT_FALSE(machine.result().passed) << name << ", run " << run;
        }
    }
}

TEST(Procedures, ARecordingGivesTheSameListAndTheSameMoments) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const Session session = play(expert_of(exercise));
        const auto bytes = write_sequence(sequence_from_session(session), SequenceForm::mha);
        const auto sequence = read_sequence(bytes, "recording");
        ASSERT_TRUE(sequence);
        const auto read = session_from_sequence(*sequence, guess_names(*sequence), "recording");
        ASSERT_TRUE(read);
        const ProcedureResult live = judge(session, exercise), scored = judge(*read, exercise);
        ASSERT_EQ(live.items.size(), scored.items.size());
        for (std::size_t i = 0; i < live.items.size(); ++i) {
            EXPECT_EQ(live.items[i].ticked, scored.items[i].ticked);
            EXPECT_EQ(live.items[i].time_s, scored.items[i].time_s);
        }
        EXPECT_EQ(live.injected_ml, scored.injected_ml);
        EXPECT_EQ(live.drained_ml, scored.drained_ml);
    }
}

TEST(Procedures, WhatLeavesTheCollectionIsWhatItHeld) {
    const Exercise exercise = procedure_called("abscess-drainage");
    const ProcedureResult result = judge(play(expert_of(exercise)), exercise);
    const double held_ml = 4.0 / 3 * kPi * 14 * 14 * 14 / 1000;
    EXPECT_NEAR(result.aspirated_ml + result.drained_ml, held_ml, 1e-9);
    EXPECT_EQ(result.injected_ml, 6);
}

}  // namespace
}  // namespace sonocase
