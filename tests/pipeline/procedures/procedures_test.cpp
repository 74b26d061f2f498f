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
#include "formats/scoring/draw_attempt.h"
#include "formats/scoring/procedure_run.h"
#include "pipeline/procedures/analytic_anatomy.h"
#include "support/hard_case.h"
#include "support/paths.h"

namespace sonocase {
namespace {

using testing::HardCase;

bool in_the_neck(const std::string& procedure) {
    return procedure == "central-line" || procedure == "jugular-across";
}

// Where a procedure takes place: the demonstration's torso, or the neck by rule.
const testing::AnalyticAnatomy& body_of(const std::string& procedure) {
    static const testing::AnalyticAnatomy torso, neck(7);
    return in_the_neck(procedure) ? neck : torso;
}

Exercise procedure_called(const std::string& name) {
    const std::string folder = in_the_neck(name) ? "neck/" : "procedures/";
    const std::string path = SONOCASE_SOURCE "/scenarios/" + folder + name + ".toml";
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
    static const std::vector<std::string> names{
        "liver-biopsy", "renal-biopsy",  "abscess-drainage", "nephrostomy",    "fast",
        "central-line", "first-picture", "planes",           "jugular-across", "paracentesis"};
    return names;
}

Rigid along(Point3 origin, Vector3 z, Vector3 x) {
    z = normalized(z);
    x = normalized(x - dot(x, z) * z);
    return {Matrix3::from_columns(x, cross(z, x), z), origin - Point3{}};
}

const Sweep& expert_of(const Exercise& exercise) {
    for (const Sweep& sweep : exercise.sweeps)
        if (sweep.name == "expert") return sweep;
    ADD_FAILURE() << exercise.name << " has no expert";
    return exercise.sweeps.front();
}

// The script at 20 samples per second, straight from key to key. A vein closes under a face that is
// more than 3 mm below the resting skin; how it does so is tested where pictures are.
Session play(const Exercise& exercise) {
    const Sweep& sweep = expert_of(exercise);
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
        const Rigid& pose = sample.mannequin_from_probe;
        const double pressed_mm =
            body_of(exercise.name)
                .exit_distance(Point3{} + pose.translation, -1 * pose.rotation.column(2), 10);
        sample.has_press = true;
        sample.press.vein_open = pressed_mm > 3 ? 0.2 : 1;
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

ProcedureResult judge(const Session& session, const Exercise& exercise) {
    const testing::AnalyticAnatomy& body = body_of(exercise.name);
    return *procedure_result(session, exercise, &body, body.labels());
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

// True if a step can only be performed after step s.
bool waits_for(const Exercise& exercise, std::size_t step, int s) {
    const auto& steps = exercise.procedure.steps;
    return steps[step].entry.step == steps[static_cast<std::size_t>(s)].name;
}

// What went missing because of step s alone: steps over a wire cannot be done without one, and
// their items go with that of the wire. Without a wire none is kept, without a core nothing spared
// by it.
std::vector<std::string> missed_by(const Exercise& exercise, int s, const ProcedureResult& result) {
    std::vector<std::string> names = missed(result);
    const auto& steps = exercise.procedure.steps;
    for (const ProcedureItem& item : exercise.procedure.items) {
        const bool of_wire = item.condition.complication == "wire_lost" &&
                             steps[s].done.act == static_cast<int>(ActKind::wire);
        const bool of_core = !item.condition.taken.empty() &&
                             steps[s].done.act == static_cast<int>(ActKind::core_throw);
        if (item.rule == ItemRule::never && (of_wire || of_core))
            std::erase(names, item.name + " not_tried");
    }
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
        const ProcedureResult result = judge(play(exercise), exercise);
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

// What an attempt draws, its picture shows from where the expert looks, and its answers mean.
TEST(Procedures, WhoReadsThePictureAnswersRightWhateverIsDrawn) {
    int there = 0, absent = 0;
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const testing::AnalyticAnatomy& body = body_of(name);
        const auto& items = exercise.procedure.items;
        if (std::all_of(items.begin(), items.end(),
                        [](const ProcedureItem& item) { return item.finding.empty(); }))
            continue;
        for (std::uint64_t seed = 1; seed <= 12; ++seed) {
            const Exercise drawn = draw_attempt(exercise, body, body.labels(), seed).exercise;
            Session session = play(drawn);
            Exercise watched = drawn;  // with a step for each that the picture may show
            for (const ProcedureItem& item : items) {
                ProcedureStep& step = watched.procedure.steps.emplace_back();
                step.group = "seen";
                step.done.shows = {item.finding.empty() ? "nothing" : item.finding};
                step.done.shows_at_least = 0.004;
            }
            const ProcedureResult seen = judge(session, watched);
            for (SessionSample& sample : session.samples) {
                ActList acts;
                for (int a = 0; a < sample.acts.count; ++a) {
                    Act act = sample.acts.acts[a];
                    const auto asked = static_cast<std::size_t>(act.index);
                    if (act.kind == ActKind::answer && !items[asked].finding.empty()) {
                        const bool shows =
                            seen.steps[drawn.procedure.steps.size() + asked].time_s >= 0;
                        act.amount = shows ? items[asked].answer : items[asked].answer_without;
                        ++(shows ? there : absent);
                    }
                    acts.add(act);
                }
                sample.acts = acts;
            }
            const ProcedureResult result = judge(session, drawn);
            EXPECT_EQ(joined(missed(result)), "") << name << ", attempt " << seed;
            EXPECT_TRUE(result.passed) << name << ", attempt " << seed;
        }
    }
    EXPECT_GT(there, 8);
    EXPECT_GT(absent, 8);
}

TEST(Procedures, WhoSkipsAnActFailsItsItemAlone) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        for (int s = 0; s < static_cast<int>(exercise.procedure.steps.size()); ++s) {
            const Condition& done = exercise.procedure.steps[s].done;
            if (done.act < 0) continue;
            Session session = play(exercise);
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
            Session session = play(exercise);
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
            Session session = play(exercise);
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
        const Session expert = play(exercise);
        const ProcedureResult whole = judge(expert, exercise);
        for (int s = 0; s < static_cast<int>(exercise.procedure.steps.size()); ++s) {
            const ProcedureStep& step = exercise.procedure.steps[s];
            if (step.done.act >= 0 || step.done.shows.empty()) continue;
            // Everything is hidden before the next step that does not wait for this one, so that
            // the first look comes too late; of a later look the time since the step before; of one
            // group only the seconds that count, since the pose is not taken up again.
            const double at_s = whole.steps[s].time_s;
            std::size_t next = 1;
            const double end_s = expert.samples.back().time_s;
            while (next + 1 < whole.steps.size() && waits_for(exercise, next, s)) ++next;
            Session session = expert;
            for (SessionSample& sample : session.samples) {
                const double t = sample.time_s;
                const bool here =
                    !step.group.empty() ? std::abs(t - at_s) < 5
                    : s == 0 ? t < (next < whole.steps.size() ? whole.steps[next].time_s : end_s)
                             : t > whole.steps[s - 1].time_s && t < at_s + 0.3;
                if (here) sample.probe_ok = false;
            }
            const ProcedureResult result = judge(session, exercise);
            std::vector<std::string> lost = missed(result);
            // After a step that was never performed nobody is asked about it.
            const StepState state = result.steps[static_cast<std::size_t>(s)].state;
            const bool never = state == StepState::missed || state == StepState::waiting;
            for (const ProcedureItem& item : exercise.procedure.items) {
                if (!never || item.rule != ItemRule::asked || item.from_step != s) continue;
                EXPECT_EQ(std::erase(lost, item.name + " not_answered"), 1u) << joined(lost);
            }
            for (std::size_t other = 0; other < exercise.procedure.steps.size(); ++other)
                if (waits_for(exercise, other, s))
                    std::erase(lost, item_of(exercise, static_cast<int>(other)) + " not_done");
            // What must not follow this step cannot go well without it.
            for (const ProcedureItem& item : exercise.procedure.items)
                if (item.rule == ItemRule::never && item.condition.step == step.name)
                    std::erase(lost, item.name + " not_tried");
            ASSERT_EQ(lost.size(), 1u) << name << ": " << joined(lost);
            EXPECT_EQ(lost[0].find(item_of(exercise, s)), 0u) << lost[0];
        }
    }
}

TEST(Procedures, WhoInsertsNothingSparesNothing) {
    int judged = 0;
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        Session looks = play(exercise);
        for (SessionSample& sample : looks.samples) {
            sample.needle_ok = false;
            sample.acts = {};
        }
        const ProcedureResult result = judge(looks, exercise);
        for (std::size_t i = 0; i < result.items.size(); ++i) {
            const ProcedureItem& item = exercise.procedure.items[i];
            if (item.rule != ItemRule::never) continue;
            // A turn of the patient or a firm press would have been possible without a needle.
            const bool of_probe = item.condition.force_at_least_n >= 0;
            const bool of_act = item.condition.act >= 0 && item.condition.step.empty();
            const bool may_tick = of_probe || of_act;
            EXPECT_EQ(result.items[i].ticked, may_tick) << name << " " << item.name;
            EXPECT_EQ(result.items[i].why, may_tick ? "" : "not_tried") << name << " " << item.name;
            ++judged;
        }
        // Nobody at all: not even the probe was there.
        Session nobody = looks;
        for (SessionSample& sample : nobody.samples) sample.probe_ok = sample.has_press = false;
        EXPECT_EQ(judge(nobody, exercise).points, 0) << name;
    }
    EXPECT_GT(judged, 10);
}

TEST(Procedures, AThousandRandomSessionsNeitherCrashNorPass) {
    HardCase passes("of 1,000 random sessions, passed", HardCase::at_most, 0, "");
    int passed = 0;
    RandomStream random(2027);
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const testing::AnalyticAnatomy& body = body_of(name);
        const Session expert = play(exercise);
        for (int run = 0; run < 1000 / static_cast<int>(procedures().size()) + 1; ++run) {
            ProcedureRun machine(exercise,
                                 std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), &body),
                                 body.labels());
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
            passed += machine.result().passed;
        }
    }
    passes.see(passed);
}

TEST(Procedures, ARecordingGivesTheSameListAndTheSameMoments) {
    for (const std::string& name : procedures()) {
        const Exercise exercise = procedure_called(name);
        const Session session = play(exercise);
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

TEST(Procedures, HeadDownAndStrainingFillTheVeins) {
    const Exercise exercise = procedure_called("central-line");
    const Session session = play(exercise);
    const testing::AnalyticAnatomy& body = body_of(exercise.name);
    ProcedureRun machine(exercise, std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), &body),
                         body.labels());
    double time_s = 0;
    const auto after = [&](const char* acts) {
        SessionSample sample = session.samples.front();
        sample.time_s = time_s += 0.1;
        sample.acts = acts_of(acts);
        machine.update(sample);
        return machine.scene();
    };
    const Deformation& d = exercise.deformation;
    EXPECT_EQ(after("").vein_wall_mm, d.vein_level_mm);
    EXPECT_EQ(after("").venous_pressure_mmhg, d.venous_pressure_mmhg);
    // 200 mm of blood, 0.078 mmHg for a millimetre, times the sine of 15 degrees.
    const double more_mmhg = 200 * 0.078 * std::sin(15 * kPi / 180);
    const SceneChange tilted = after("tilt=15");
    EXPECT_NEAR(tilted.venous_pressure_mmhg, d.venous_pressure_mmhg + more_mmhg, 1e-9);
    EXPECT_NEAR(tilted.vein_wall_mm,
                d.vein_level_mm + d.vein_swell_mm * (1 - std::exp(-more_mmhg / 2.7)), 1e-9);
    const SceneChange strained = after("valsalva=1");
    EXPECT_GT(strained.vein_wall_mm, tilted.vein_wall_mm);
    EXPECT_LE(strained.vein_wall_mm, d.vein_level_mm + d.vein_swell_mm);
    EXPECT_GT(strained.venous_pressure_mmhg, tilted.venous_pressure_mmhg + 19);
    EXPECT_LT(after("valsalva=0;tilt=-15").vein_wall_mm, d.vein_level_mm);  // head up: emptier
    EXPECT_EQ(after("tilt=0").vein_wall_mm, d.vein_level_mm);
    EXPECT_EQ(after("tilt=1e5").venous_pressure_mmhg, after("tilt=45").venous_pressure_mmhg);
    // Where the exercise does not ask for it, nothing moves.
    const Exercise biopsy = procedure_called("liver-biopsy");
    EXPECT_EQ(ProcedureRun(biopsy, nullptr, {}).scene().vein_wall_mm, 0);
}

TEST(Procedures, WhatGoesWrongInTheNeckIsNamed) {
    const Exercise exercise = procedure_called("central-line");
    const SessionSample still = play(exercise).samples.front();
    const testing::AnalyticAnatomy& body = body_of(exercise.name);
    const pipeline::NeckVessels v = pipeline::NeckAnatomy(7).vessels(true);
    // Pushes the needle to `target` and past it; what happened, in order of time.
    const auto pushed = [&](Point3 target, Vector3 way, double past_mm, const char* acts = "") {
        ProcedureRun machine(exercise,
                             std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), &body),
                             body.labels());
        SessionSample sample = still;
        sample.needle_ok = true;
        double time_s = 0;
        for (double s = -60; s <= past_mm; s += 0.5) {
            sample.time_s = time_s += 0.02;
            sample.mannequin_from_needle = sample.mannequin_from_drawn =
                along(target + s * normalized(way), way, any_perpendicular(normalized(way)));
            machine.update(sample);
        }
        sample.acts = acts_of(acts);
        sample.time_s = time_s += 0.02;
        machine.update(sample);
        std::vector<std::string> names;
        for (const auto& one : machine.result().complications) names.push_back(one.name);
        EXPECT_FALSE(machine.result().passed);
        return joined(names);
    };
    EXPECT_EQ(pushed(v.vein, -1 * v.outwards, 0), "");
    EXPECT_EQ(pushed(v.artery, -1 * v.outwards, 0), "through_and_through, artery_punctured");
    EXPECT_EQ(pushed(v.artery, -1 * v.sideways, 0), "artery_punctured");  // under the vein
    EXPECT_EQ(pushed(v.vein, -1 * v.outwards, 12), "through_and_through");
    EXPECT_EQ(pushed({38, 4, -55}, {0, -0.1, -1}, 0), "pneumothorax");
    EXPECT_EQ(pushed(v.vein, -1 * v.outwards, 0, "wire=300;wire=150"), "wire_lost");
    EXPECT_EQ(pushed(v.vein, -1 * v.outwards, 0, "inject=1"), "intravascular_injection");
}

// Air spreads from where the lung was hit, at the same pace in any order of samples, and stays.
TEST(Procedures, AirSpreadsFromALungThatWasHit) {
    const Exercise exercise = procedure_called("central-line");
    const testing::AnalyticAnatomy& body = body_of(exercise.name);
    for (const double dt_s : {0.02, 0.1}) {
        ProcedureRun machine(exercise,
                             std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), &body),
                             body.labels());
        SessionSample sample = play(exercise).samples.front();
        sample.needle_ok = true;
        const Point3 lung{38, 4, -55};
        const Vector3 way = normalized(Vector3{0, -0.1, -1});
        const auto at = [&](double mm) {
            sample.mannequin_from_needle = sample.mannequin_from_drawn =
                along(lung + mm * way, way, any_perpendicular(way));
            sample.time_s += dt_s;
            machine.update(sample);
            return machine.scene().air;
        };
        sample.time_s = 0;
        EXPECT_EQ(at(-60).radius_mm, 0);
        double mm = -60;
        SceneChange::Air first{};
        while (first.radius_mm == 0 && mm < 5) first = at(mm += 0.5);
        ASSERT_GT(first.radius_mm, 0);
        EXPECT_LT(distance(first.centre, lung + mm * way), 1e-9);
        const double since_s = sample.time_s;
        SceneChange::Air later{};
        while (sample.time_s < since_s + 5) later = at(-60);
        EXPECT_EQ(later.centre.x, first.centre.x);
        EXPECT_NEAR(later.radius_mm, 30, 6 * 2 * dt_s);  // 6 mm/s
        while (sample.time_s < since_s + 60) later = at(-60);
        EXPECT_EQ(later.radius_mm, 60);
    }
}

TEST(Procedures, WhatLeavesTheCollectionIsWhatItHeld) {
    HardCase off("volume that left, off what it held", HardCase::at_most, 1e-9, "ml");
    const Exercise exercise = procedure_called("abscess-drainage");
    const ProcedureResult result = judge(play(exercise), exercise);
    const double held_ml = 4.0 / 3 * kPi * 14 * 14 * 14 / 1000;
    off.see(std::abs(result.aspirated_ml + result.drained_ml - held_ml));
    EXPECT_EQ(result.injected_ml, 6);
}

// One sample after the other with the tip at a place, the needle along `way`.
class Held {
  public:
    explicit Held(const std::string& name)
        : exercise_(procedure_called(name)),
          body_(body_of(name)),
          machine_(exercise_,
                   std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), &body_),
                   body_.labels()) {}
    const ProcedureState& at(Point3 tip, Vector3 way, const std::string& acts, double open = -1) {
        SessionSample sample;
        sample.time_s = time_s_ += 0.1;
        sample.probe_ok = true;
        sample.mannequin_from_probe =
            along(exercise_.start_probe, exercise_.start_beam, any_perpendicular(normalized(way)));
        sample.needle_ok = true;
        sample.mannequin_from_drawn = along(tip, way, any_perpendicular(normalized(way)));
        sample.has_press = true;
        sample.press.vein_open = open;
        sample.acts = acts_of(acts);
        machine_.update(sample);
        return machine_.state();
    }
    std::string drawn() const { return aspirate_names()[machine_.state().aspirated]; }
    const ProcedureRun& machine() const { return machine_; }
    const Exercise& exercise() const { return exercise_; }
    const testing::AnalyticAnatomy& body() const { return body_; }

  private:
    Exercise exercise_;
    const testing::AnalyticAnatomy& body_;
    ProcedureRun machine_;
    double time_s_ = 0;
};

TEST(Procedures, AVeinThatIsPressedShutGivesNoBlood) {
    Held held("central-line");
    const Point3 vein = held.exercise().targets[0].centre;
    const Vector3 way{-0.2971, -0.6417, -0.7071};
    held.at(vein, way, "aspirate=1", 0.05);
    EXPECT_EQ(held.drawn(), "nothing");
    HardCase shut("lumen left of a vein up to which it gives nothing", HardCase::at_most, 0.1, "");
    for (int percent = 1; percent < 50; ++percent) {
        held.at(vein, way, "aspirate=1", 0.01 * percent);
        if (held.drawn() != "nothing") break;
        shut.see(0.01 * percent);
    }
    held.at(vein, way, "aspirate=1", 0.5);
    EXPECT_EQ(held.drawn(), "blood");
    held.at(vein, way, "aspirate=1");  // nothing is known of its closing
    EXPECT_EQ(held.drawn(), "blood");
}

TEST(Procedures, WhatIsDrainedToNothingStaysAtNothingAndCanBeFilledAgain) {
    Held held("abscess-drainage");
    const Target& abscess = held.exercise().targets[0];
    const double full_ml = held.machine().volume_ml(0);
    const Vector3 way = -1 * (abscess.centre - held.exercise().start_probe);
    for (int i = 0; i < 40; ++i) held.at(abscess.centre, -1 * way, "drain=5;aspirate=3");
    EXPECT_EQ(held.machine().volume_ml(0), 0);
    EXPECT_NEAR(held.machine().state().drained_ml + held.machine().state().aspirated_ml, full_ml,
                1e-9);
    EXPECT_EQ(held.machine().scene().target_scale[0], 0);
    EXPECT_NE(held.drawn(), "pus");
    held.at(abscess.centre, -1 * way, "inject=4");
    EXPECT_NEAR(held.machine().volume_ml(0), 4, 1e-9);
    EXPECT_NEAR(held.machine().scene().target_scale[0], std::cbrt(4 / full_ml), 1e-6);
}

TEST(Procedures, AWireOutsideTheBodyOrTheVesselIsNoneInIt) {
    Held held("central-line");
    const Vector3 way{-0.2971, -0.6417, -0.7071};
    const Point3 vein = held.exercise().targets[0].centre;
    // In air there is no wire, and nothing goes over it.
    const Point3 air = vein - 60 * normalized(way);
    EXPECT_FALSE(held.at(air, way, "wire=100;dilate=1;catheter=1").wire_in);
    EXPECT_FALSE(held.machine().state().catheter_in);
    EXPECT_EQ(held.machine().state().wire_mm, 0);
    // Before the vein it is in, and goes straight on instead of along the vein; drawn back it is
    // out again, however far it is drawn.
    const Point3 before = vein - 14 * normalized(way);
    EXPECT_TRUE(held.at(before, way, "wire=60").wire_in);
    const SceneChange::Line wire = held.machine().scene().wire;
    HardCase straight("turn of a wire before the vessel", HardCase::at_most, 1e-6, "rad");
    straight.see(norm(cross(normalized(wire.to - wire.turn), normalized(way))));
    EXPECT_FALSE(held.at(before, way, "wire=-1000").wire_in);
    EXPECT_EQ(held.machine().state().wire_mm, 0);
}

TEST(Procedures, AnInjectionIntoBoneIsLostAndOneUnderItIsKept) {
    HardCase off("injected volume behind bone, off", HardCase::at_most, 1e-9, "ml");
    Held held("liver-biopsy");
    const testing::AnalyticAnatomy& body = held.body();
    // A rib on the way in from the right flank, with tissue that takes fluid 3 mm behind it.
    const auto tissue = [&](Point3 p) {
        return body.labels()[static_cast<std::size_t>(body.label(p))].tissue;
    };
    const Vector3 way{-1, 0, 0};
    Point3 bone{}, under{};
    bool found = false;
    for (double z = -20; z <= 90 && !found; z += 2)
        for (double x = 175; x > 60 && !found; x -= 1) {
            bone = under = {x, 0, z};
            if (tissue(bone) != "bone") continue;
            while (tissue(under) == "bone") under.x -= 1;
            under.x -= 3;
            found = body.inside(under) && !body.blocks_sound(body.label(under));
        }
    ASSERT_TRUE(found);
    const ProcedureState& state = held.at(bone, way, "inject=3");
    EXPECT_EQ(state.injected_ml, 0);
    EXPECT_EQ(state.injected_lost_ml, 3);
    EXPECT_EQ(state.pool_count, 0);
    held.at(under, way, "inject=3");
    EXPECT_EQ(state.injected_ml + state.injected_lost_ml, 6);
    EXPECT_EQ(state.injected_ml, 3);
    ASSERT_EQ(state.pool_count, 1);
    const SceneChange::Pool pool = held.machine().scene().pools[0];
    off.see(std::abs(4.0 / 3 * kPi * std::pow(pool.radius_mm, 3) / 1000 - 3));
}

// What was injected before the vein pushes it away from the needle, in the picture and for the tip.
TEST(Procedures, FluidBeforeAVeinPushesItAwayFromTheTip) {
    Held held("central-line");
    const Vector3 way = normalized(Vector3{-0.2971, -0.6417, -0.7071});
    const Point3 vein = held.exercise().targets[0].centre;
    Point3 wall = vein;
    const int blood = held.body().label(vein);
    while (held.body().label(wall) == blood) wall = wall - 0.1 * way;
    held.at(wall + 1 * way, way, "aspirate=1");
    EXPECT_EQ(held.drawn(), "blood");
    const ProcedureState& state = held.at(wall - 2 * way, way, "inject=2");
    ASSERT_EQ(state.pool_count, 1);
    ASSERT_EQ(state.injected_ml, 2);
    // A ball of 2 ml has a radius of 7.8 mm: the wall, 2 mm before it, moves to 8 mm.
    held.at(wall + 1 * way, way, "aspirate=1");
    EXPECT_EQ(held.drawn(), "nothing");
    held.at(wall + 4 * way, way, "aspirate=1");
    EXPECT_EQ(held.drawn(), "nothing");
    held.at(wall + 7 * way, way, "aspirate=1");
    EXPECT_EQ(held.drawn(), "blood");
}

TEST(Procedures, FreeFluidRunsToWhereIsLowestAndLeavesWithTheDrain) {
    Held held("paracentesis");
    const FreeFluid& fluid = held.exercise().free_fluids.front();
    const Point3 left{-95, 50, -92}, right{95, 50, -92};  // in fat, high in the flanks
    const Vector3 way{0.953, -0.303, 0};
    const auto tip_gives = [&](Point3 tip, const char* acts) {
        held.at(tip, way, acts);
        held.at(tip, way, "aspirate=1");
        return held.drawn();
    };
    EXPECT_EQ(tip_gives(left, ""), "nothing");
    EXPECT_EQ(tip_gives(left, "turn=30"), "fluid");
    EXPECT_EQ(tip_gives(right, ""), "nothing");
    EXPECT_EQ(tip_gives(right, "turn=-30"), "fluid");
    EXPECT_EQ(tip_gives(left, ""), "nothing");
    EXPECT_EQ(tip_gives(left, "turn=30"), "fluid");
    held.at(left, way, "catheter=1");
    EXPECT_EQ(held.machine().state().turned_deg, 30);
    const double before_mm = held.machine().scene().levels[0].mm;
    held.at(left, way, "drain=250");
    EXPECT_LT(held.machine().scene().levels[0].mm, before_mm - 3);
    for (int i = 0; i < 8; ++i) held.at(left, way, "drain=250");
    EXPECT_EQ(held.machine().free_fluid_ml(), 0);
    EXPECT_NEAR(held.machine().state().drained_ml + held.machine().state().aspirated_ml, fluid.ml,
                1e-9);
    EXPECT_EQ(tip_gives(left, ""), "nothing");
    held.at(left, way, "turn=400;tilt=-400");
    EXPECT_EQ(held.machine().state().turned_deg, 90);
}

}  // namespace
}  // namespace sonocase
