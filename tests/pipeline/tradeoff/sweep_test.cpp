// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/sweep.h"

#include <gtest/gtest.h>

#include <cmath>

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

}  // namespace
}  // namespace sonocase::pipeline
