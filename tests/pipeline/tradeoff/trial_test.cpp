// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/sweep.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/random.h"

namespace sonocase::pipeline {
namespace {

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

}  // namespace
}  // namespace sonocase::pipeline
