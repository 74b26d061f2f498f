// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/class_records.h"
#include "support/hard_case.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sonocase::runtime {
namespace {

// Each expected value is worked out beside it.
TEST(Reliability, AlphaIsThatOfTheFormula) {
    // Attempts that agree up to a shift: alpha is 1.
    EXPECT_NEAR(cronbach_alpha({{1, 2, 3}, {2, 3, 4}, {5, 6, 7}}), 1, 1e-12);
    // Two items: variances 1 and 1, sums 3, 3, 6 of variance 3: 2 (1 - 2 / 3).
    EXPECT_NEAR(cronbach_alpha({{1, 2}, {2, 1}, {3, 3}}), 2.0 / 3, 1e-12);
    // Attempts that contradict each other: sums hardly differ.
    EXPECT_LT(cronbach_alpha({{1, 5}, {5, 1.5}, {3, 3}}), 0);
    // One trainee, no spread, nobody, one attempt each.
    sonocase::testing::HardCase given("of four tables that have no alpha, given one",
                                      sonocase::testing::HardCase::at_most, 0, "");
    given.see(4 - std::isnan(cronbach_alpha({{1, 2}})) -
              std::isnan(cronbach_alpha({{1, 2}, {1, 2}})) - std::isnan(cronbach_alpha({})) -
              std::isnan(cronbach_alpha({{1}, {2}})));
}

TEST(Reliability, ThePassMarkIsWhereTheGroupsCross) {
    // Equal spread: half way.
    const ContrastingGroups even =
        contrasting_groups(std::vector<double>{3, 4, 5}, std::vector<double>{9, 10, 11});
    EXPECT_NEAR(even.mark, 7, 1e-12);
    EXPECT_EQ(even.experts_failed, 0);
    EXPECT_EQ(even.novices_passed, 0);
    // Novices differ more: the mark lies nearer the experts, and there both densities are equal.
    const std::vector<double> experts{3, 4, 5}, novices{2, 10, 18};
    const ContrastingGroups wide = contrasting_groups(experts, novices);
    EXPECT_LT(wide.mark, 7);
    EXPECT_GT(wide.mark, 4);
    const auto density = [&](double m, double v) {
        return std::exp(-(wide.mark - m) * (wide.mark - m) / (2 * v)) / std::sqrt(v);
    };
    sonocase::testing::HardCase off("densities of both groups at the pass mark, off each other",
                                    sonocase::testing::HardCase::at_most, 1e-12, "");
    off.see(std::abs(density(4, 1) - density(10, 64)));
    EXPECT_NEAR(wide.novices_passed, 1.0 / 3, 1e-12);
    // Experts who are no better have no mark, nor have groups of one.
    EXPECT_TRUE(std::isnan(contrasting_groups(novices, experts).mark));
    EXPECT_TRUE(std::isnan(contrasting_groups(std::vector<double>{3}, novices).mark));
}

TEST(Reliability, ComesFromFirstAttemptsAndTheGroupsThatTheEducatorNames) {
    std::vector<ProgressEntry> entries;
    const auto add = [&](const char* trainee, const char* exercise, double mm) {
        ProgressEntry entry;
        entry.trainee = trainee;
        entry.exercise = exercise;
        entry.metrics = {{"final_tip_to_target_mm", mm}};
        entries.push_back(entry);
    };
    for (const double shift : {0.0, 1.0, 2.0}) add("A", "liver", 10 + shift);
    for (const double shift : {0.0, 1.0, 2.0, 30.0}) add("B", "liver", 14 + shift);
    for (const double shift : {0.0, 0.5}) add("E", "liver", 3 + shift);
    add("A", "kidney", 1);
    const ExerciseReliability found = exercise_reliability(entries, {"", "liver"}, {"E"});
    EXPECT_EQ(found.trainees, 2);  // E has two attempts only
    EXPECT_NEAR(found.alpha, 1, 1e-12);
    EXPECT_EQ(found.groups.experts, 2);
    EXPECT_EQ(found.groups.novices, 2);  // first attempts: 10 and 14
    EXPECT_GT(found.groups.mark, 3.25);
    EXPECT_LT(found.groups.mark, 12);
    EXPECT_EQ(exercise_reliability(entries, {"", "spleen"}, {}).trainees, 0);
}

}  // namespace
}  // namespace sonocase::runtime
