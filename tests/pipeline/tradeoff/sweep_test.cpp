// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/sweep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/tradeoff/suites.h"
#include "support/random.h"

namespace sonocase::pipeline {
namespace {

Suite suite(int& runs) {
    Suite s;
    s.name = "toy";
    s.body = "none";
    s.knobs = {{"toy.n", {"1", "2", "4", "8"}, "2", "", "", "", ""},
               {"toy.m", {"1", "3"}, "1", "", "", "", ""}};
    s.pairs = {{"toy.n", "toy.m"}};
    s.named = {{TrialRole::preset, "draft", {{"toy.n", "1"}}}};
    s.measure = [&runs](const Settings& settings) -> Result<Measured> {
        ++runs;
        for (const Setting& setting : settings) {
            if (setting.value == "8") return Error{"too many", "toy", ""};
        }
        return Measured{1.0 / static_cast<double>(settings.size() + 1), 0.5, ""};
    };
    return s;
}

TEST(Sweep, PlanHoldsStandardNamedKnobsAndPairsOnce) {
    int runs = 0;
    const Suite s = suite(runs);
    const auto full = plan_sweep(s, {});
    // 1 standard, 1 preset, 4 + 2 knob values, and pairs of (1, 4, 8) with 3 off the standard.
    EXPECT_EQ(full.size(), 1u + 1 + 6 + 3);
    SweepOptions quick;
    quick.quick = true;
    // Of toy.n the ends and the standard value.
    EXPECT_EQ(plan_sweep(s, quick).size(), 1u + 1 + 5);
}

TEST(Sweep, ResumedSweepMeasuresOnlyWhatIsMissing) {
    int runs = 0;
    const Suite s = suite(runs);
    SweepOptions options;
    options.repeats = 3;
    const auto plan = plan_sweep(s, options);
    const auto first = run_sweep(s, plan, {}, options, {}, {});
    const int once = runs;
    const auto again = run_sweep(s, plan, first, options, {}, {});
    EXPECT_EQ(runs, once);
    EXPECT_EQ(again.size(), first.size());
}

TEST(Sweep, ResumesFromItsFileWhateverTheNames) {
    int runs = 0;
    Suite s = suite(runs);
    s.named.push_back({TrialRole::paper, "paper, eq. (10), K0 = 1", {{"toy.k", "1"}}});
    const auto plan = plan_sweep(s, {});
    const auto first = run_sweep(s, plan, {}, {}, {}, {});
    const auto kept = parse_trials_csv(format_trials_csv(first), "kept.csv");
    ASSERT_TRUE(kept);
    const int once = runs;
    const auto again = run_sweep(s, plan, *kept, {}, {}, {});
    EXPECT_EQ(runs, once);
    for (std::size_t i = 0; i < plan.size(); ++i) EXPECT_EQ(again[i].name, plan[i].name);
}

TEST(Sweep, SettingsThatComeToTheSameAreMeasuredOnce) {
    int runs = 0;
    const Suite s = suite(runs);
    SweepOptions options;
    options.repeats = 1;
    const auto plan = plan_sweep(s, options);
    const auto trials = run_sweep(s, plan, {}, options, {}, {});
    EXPECT_EQ(trials.size(), plan.size());
    // Standard, toy.n = 2 and toy.m = 1 are one; the preset and toy.n = 1 another.
    EXPECT_EQ(runs, static_cast<int>(plan.size()) - 3);
    for (std::size_t i = 0; i < plan.size(); ++i) {
        EXPECT_EQ(trials[i].settings, plan[i].settings);
        EXPECT_EQ(trials[i].role, plan[i].role);
        EXPECT_EQ(trials[i].name, plan[i].name);
    }
}

// A standard is beaten by what is no worse in both and better in one by more than noise.
TEST(Sweep, ABeatenStandardIsFoundWithTheReasonWhyItStays) {
    Suite s;
    s.knobs = {{"a", {"1", "2", "3", "4"}, "2", "", "", "", "", "it is kept for the body"},
               {"b", {"1", "2"}, "1", "", "", "", ""}};
    s.named = {{TrialRole::peer, "other", {{"c", "1"}}, "it is another question"}};
    const auto trial = [](TrialRole role, const char* name, Settings settings, double error,
                          double seconds) {
        Trial t;
        t.role = role;
        t.name = name;
        t.settings = std::move(settings);
        t.error = error;
        t.seconds = seconds;
        return t;
    };
    const std::vector<Trial> trials = {
        trial(TrialRole::standard, "standard", {}, 1, 10),
        trial(TrialRole::knob, "a", {{"a", "1"}}, 1.01, 8),    // as good, a fifth cheaper
        trial(TrialRole::knob, "a", {{"a", "3"}}, 0.9, 9),     // better in both, by noise
        trial(TrialRole::knob, "a", {{"a", "4"}}, 0.5, 10.5),  // better, but dearer
        trial(TrialRole::knob, "b", {{"b", "2"}}, 0.8, 10),
        trial(TrialRole::peer, "other", {{"c", "1"}}, 0.7, 5),
        trial(TrialRole::knob, "a", {{"a", "2"}}, NAN, NAN),  // failed
    };
    const auto beaten = beaten_standard(s, trials, 0.15);
    ASSERT_EQ(beaten.size(), 3u);
    EXPECT_EQ(settings_text(beaten[0].by.settings), "a=1");
    EXPECT_EQ(beaten[0].why_standard, "it is kept for the body");
    EXPECT_EQ(settings_text(beaten[1].by.settings), "b=2");
    EXPECT_EQ(beaten[1].why_standard, "");
    EXPECT_EQ(beaten[2].why_standard, "it is another question");
    EXPECT_TRUE(beaten_standard(s, {trials.begin() + 1, trials.end()}, 0.15).empty());
}

TEST(Sweep, FailedSettingIsKeptWithItsMessage) {
    int runs = 0;
    const Suite s = suite(runs);
    bool seen = false;
    for (const Trial& t : run_sweep(s, plan_sweep(s, {}), {}, {}, {}, {})) {
        if (t.settings == Settings{{"toy.n", "8"}}) {
            seen = true;
            EXPECT_TRUE(std::isnan(t.error));
            EXPECT_EQ(t.note, "toy: too many");
        }
    }
    EXPECT_TRUE(seen);
}

Trial trial(double seconds, double error) {
    Trial t;
    t.suite = "warp";
    t.body = "demo-torso";
    t.name = "warp.steps";
    t.settings = {{"warp.steps", std::to_string(seconds)}};
    t.seconds = t.seconds_low = t.seconds_high = seconds;
    t.error = error;
    t.repeats = 1;
    return t;
}

TEST(ParetoFront, KnownAnswer) {
    const auto front =
        pareto_front({trial(1, 4), trial(2, 2), trial(3, 3), trial(4, 1), trial(4, 2)});
    EXPECT_EQ(front, (std::vector<bool>{true, true, false, true, false}));
}

TEST(ParetoFront, NothingOnTheFrontIsBeatenAndEverythingElseIs) {
    sonocase::testing::Random random(31);
    std::vector<Trial> trials;
    for (int i = 0; i < 200; ++i)
        trials.push_back(trial(random.uniform(0, 1), random.uniform(0, 1)));
    const auto front = pareto_front(trials);
    for (std::size_t i = 0; i < trials.size(); ++i) {
        bool beaten = false;
        for (const Trial& other : trials) {
            beaten = beaten || (other.error < trials[i].error && other.seconds < trials[i].seconds);
        }
        EXPECT_EQ(front[i], !beaten);
    }
}

TEST(ParetoFront, AFailedTrialIsNeverCompared) {
    auto failed = trial(1, NAN);
    failed.seconds = NAN;
    const auto front = pareto_front({failed, trial(2, 1)});
    EXPECT_TRUE(front[1]);
}

TEST(JudgeCurve, NamesTheStepThatRises) {
    EXPECT_TRUE(judge_curve({trial(1, 3), trial(2, 2), trial(4, 2.01)}, 0.05).monotone);
    const CurveVerdict verdict = judge_curve({trial(1, 1), trial(2, 2)}, 0.05);
    EXPECT_FALSE(verdict.monotone);
    EXPECT_NE(verdict.worst.find("1 -> 2"), std::string::npos);
}

TEST(TrialFile, RoundTripKeepsEveryField) {
    std::vector<Trial> trials{trial(0.125, 0.5), trial(1e-7, NAN)};
    trials[0].role = TrialRole::preset;
    trials[0].note = "one label, lost";
    trials[1].settings.clear();
    const auto back = parse_trials_csv(format_trials_csv(trials), "t.csv");
    ASSERT_TRUE(back) << back.error().message();
    ASSERT_EQ(back->size(), 2u);
    EXPECT_EQ((*back)[0].role, TrialRole::preset);
    EXPECT_EQ((*back)[0].settings, trials[0].settings);
    EXPECT_EQ((*back)[0].seconds, 0.125);
    EXPECT_EQ((*back)[0].note, "one label; lost");
    EXPECT_TRUE(std::isnan((*back)[1].error));
    EXPECT_TRUE((*back)[1].settings.empty());
}

TEST(TrialFile, ADamagedRowIsNamed) {
    std::string csv = format_trials_csv({trial(1, 2)});
    csv += "warp,demo-torso,knob,x\n";
    const auto back = parse_trials_csv(csv, "t.csv");
    ASSERT_FALSE(back);
    EXPECT_EQ(back.error().where, "t.csv:3");
}

// A knob that says another standard than the stage has would set two names beside one measurement.
TEST(SuiteMake, AKnobsStandardIsThatOfItsStage) {
    const StageTable& table = built_in_stages();
    for (const Suite& suite : {make_suite(), publish_suite()}) {
        ASSERT_FALSE(suite.knobs.empty());
        EXPECT_EQ(suite.named.size(), table.presets.size());
        for (const Knob& knob : suite.knobs) {
            std::string found;
            for (const OptionGroup* group : table.option_groups())
                for (const Option& option : group->options)
                    if (option.name() == knob.key)
                        found = option_value(option, StageSettings(table).values(*group));
            EXPECT_EQ(knob.standard, found) << knob.key;
            EXPECT_NE(std::find(knob.values.begin(), knob.values.end(), knob.standard),
                      knob.values.end())
                << knob.key;
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
