// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/course_standing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/course_standing.h"
#include "formats/scoring/draw_attempt.h"

namespace sonocase::runtime {
namespace {

SessionScore score_with(std::vector<PassResult> marks, std::vector<Metric> metrics) {
    SessionScore score;
    score.pass_marks = std::move(marks);
    score.metrics = std::move(metrics);
    score.passed = true;
    for (const PassResult& mark : score.pass_marks) score.passed = score.passed && mark.passed;
    return score;
}

ProgressEntry attempt(bool passed, double mm, const std::string& exercise = "liver") {
    ProgressEntry entry;
    entry.case_name = "torso";
    entry.exercise = exercise;
    entry.passed = passed;
    entry.metrics = {{"final_tip_to_target_mm", mm}};
    return entry;
}

TEST(AttemptResult, ShowsTheWorstMissFirstAndSaysWhatToDo) {
    const auto result =
        attempt_result(score_with({{"final_tip_to_target_mm", 4, 5, -INFINITY, true},
                                   {"tip_in_view_at_advance_fraction", 0.2, INFINITY, 0.8, false},
                                   {"insertions", 3, 2, -INFINITY, false}},
                                  {}));
    ASSERT_EQ(result.rows.size(), 3u);
    EXPECT_EQ(result.rows[0].metric, "tip_in_view_at_advance_fraction");  // missed by 3/4 of it
    EXPECT_EQ(result.rows[1].metric, "insertions");                       // by a half
    EXPECT_TRUE(result.rows[2].reached);
    EXPECT_EQ(result.marks_reached, 1);
    EXPECT_FALSE(result.passed);
    EXPECT_NE(std::string(result.advice).find("fades"), std::string::npos);
    EXPECT_EQ(result.trend_metric, "tip_in_view_at_advance_fraction");
    EXPECT_LT(result.rows[0].value_at, result.rows[0].limit_at);  // on one scale
    EXPECT_GT(result.rows[1].value_at, result.rows[1].limit_at);
}

// What went wrong first is said first: not to stop in the middle of what was never found.
TEST(AttemptResult, TheAdviceFitsWhatHappened) {
    const auto advice = [](double mm, double scanned, double hit = 0) {
        return std::string(
            attempt_result(score_with({{"final_tip_to_target_mm", mm, 5, -INFINITY, mm <= 5}},
                                      {{"targets_scanned_percent", scanned}, {"targets_hit", hit}}))
                .advice);
    };
    EXPECT_EQ(advice(NAN, 0).rfind("Find the target first", 0), 0u);
    EXPECT_EQ(advice(NAN, 100).rfind("Take the needle", 0), 0u);
    EXPECT_EQ(advice(54, 100).rfind("Find the target first", 0), 0u);
    EXPECT_EQ(advice(8, 100).rfind("Stop in the middle", 0), 0u);
    EXPECT_EQ(advice(3, 100, 1), "");
    // The tip was in the target: to find it would be the wrong advice, pulled out or gone on.
    EXPECT_EQ(advice(8, 100, 1).rfind("Stop in the middle", 0), 0u);
    for (const double mm : {54.0, double{NAN}})
        EXPECT_EQ(advice(mm, 100, 1).rfind("The needle reached the target and left it", 0), 0u);
}

// Eight marks, of which the last alone is missed: "7 of 8 marks reached" stands over all eight.
TEST(AttemptResult, EveryMarkIsShownAndAMissedOneFirst) {
    std::vector<PassResult> marks;
    for (const char* name : {"insertions", "no_go_contacts", "path_in_tissue_mm", "targets_hit",
                             "tissue_damage_mm2", "probe_path_length_mm", "needle_path_length_mm"})
        marks.push_back({name, 1, 2, -INFINITY, true});
    marks.push_back({"elapsed_time_s", NAN, 60, -INFINITY, false});
    const auto result = attempt_result(score_with(marks, {}));
    ASSERT_EQ(result.rows.size(), 8u);
    EXPECT_EQ(result.rows[0].metric, "elapsed_time_s");
    EXPECT_EQ(result.marks, 8);
}

TEST(AttemptResult, FillsUpWithMeasuresThatHaveEvidenceAndNoOthers) {
    const auto result = attempt_result(score_with({}, {{"elapsed_time_s", 70},
                                                       {"tracking_gap_s", 1},  // no evidence
                                                       {"insertions", 2},
                                                       {"path_in_tissue_mm", NAN}}));
    ASSERT_EQ(result.rows.size(), 2u);
    EXPECT_EQ(result.rows[0].metric, "elapsed_time_s");
    EXPECT_FALSE(result.rows[0].has_limit);
    EXPECT_FALSE(result.has_marks);
    EXPECT_STREQ(result.advice, "");
}

TEST(AttemptResult, TheTrendEndsWithThisAttemptAndIsNotLong) {
    std::vector<ProgressEntry> earlier;
    for (int i = 0; i < 20; ++i) earlier.push_back(attempt(false, 20 - i));
    earlier.push_back(attempt(false, NAN));
    const SessionScore score = score_with({{"final_tip_to_target_mm", 3.5, 5, -INFINITY, true}},
                                          {{"final_tip_to_target_mm", 3.5}});
    AttemptResult result = attempt_result(score);
    add_trend(earlier, score, result);
    ASSERT_EQ(result.trend.size(), kMaxTrend);
    EXPECT_EQ(result.trend.back(), 3.5);
    EXPECT_EQ(result.trend[kMaxTrend - 2], 1);
}

TEST(MetricWords, AreThoseOfAClinician) {
    EXPECT_EQ(metric_words("final_tip_to_target_mm", 4.23), "4.2 mm");
    EXPECT_EQ(metric_words("tip_in_view_fraction", 0.61), "61 %");
    EXPECT_EQ(metric_words("elapsed_time_s", 107.4), "1:47");
    EXPECT_EQ(metric_words("elapsed_time_s", 59.6), "59.6 s");
    EXPECT_EQ(metric_words("insertions", 2), "2");
    EXPECT_EQ(metric_words("insertions", NAN), "–");
}

TEST(Advice, EveryMeasureThatExercisesUseAsAMarkHasSome) {
    for (const char* name :
         {"final_tip_to_target_mm", "tip_in_view_at_advance_fraction", "needle_in_beam_fraction",
          "no_go_contacts", "insertions", "tissue_damage_mm2", "elapsed_time_s", "targets_hit",
          "posterior_wall_punctures", "correct_vessel_punctured", "probe_force_max_n",
          "needle_path_length_mm", "trajectory_deviation_mm"}) {
        ASSERT_NE(find_metric(name), nullptr) << name;
        EXPECT_NE(find_metric(name)->advice[0], 0) << name;
    }
}

TEST(Standing, CountsPassesInARowAndKeepsMastery) {
    std::vector<ProgressEntry> entries = {attempt(true, 4), attempt(false, 9), attempt(true, 3)};
    entries.push_back(attempt(true, 1, "kidney"));  // another exercise does not count
    Standing now = standing(entries, "torso", "liver", 3);
    EXPECT_EQ(now.attempts, 3);
    EXPECT_EQ(now.passes, 2);
    EXPECT_EQ(now.in_a_row, 1);
    EXPECT_FALSE(now.mastered);
    EXPECT_EQ(now.best_mm, 3);
    entries.insert(entries.end(), {attempt(true, 2), attempt(true, 2), attempt(false, 8)});
    now = standing(entries, "torso", "liver", 3);
    EXPECT_TRUE(now.mastered);
    EXPECT_EQ(now.in_a_row, 0);
    EXPECT_EQ(standing({}, "torso", "liver", 3).best_mm, -1);
}

// Who was given easier attempts has not mastered the exercise as it is written.
TEST(Standing, PassesOfEasierAttemptsDoNotCountTowardsMastery) {
    std::vector<ProgressEntry> entries(5, attempt(true, 2));
    for (ProgressEntry& entry : entries) entry.seed = seed_with_difficulty(9, -1);
    EXPECT_EQ(standing(entries, "torso", "liver", 3).passes, 5);
    EXPECT_EQ(standing(entries, "torso", "liver", 3).in_a_row, 0);
    for (ProgressEntry& entry : entries) entry.seed = seed_with_difficulty(9, 2);
    EXPECT_TRUE(standing(entries, "torso", "liver", 3).mastered);
}

// Eight passes in a row, or more with failures between; a lucky three are not enough.
TEST(Standing, IsSteadyByCusumLaterThanByPassesInARow) {
    std::vector<ProgressEntry> entries(7, attempt(true, 2));
    EXPECT_TRUE(standing(entries, "torso", "liver", 3).mastered);
    EXPECT_FALSE(standing(entries, "torso", "liver", 3).steady);
    EXPECT_NEAR(standing(entries, "torso", "liver", 3).cusum, 7 * std::log(0.9 / 0.7), 1e-12);
    entries.push_back(attempt(false, 9));  // takes back four passes and a half
    EXPECT_NEAR(standing(entries, "torso", "liver", 3).cusum,
                7 * std::log(0.9 / 0.7) + std::log(0.1 / 0.3), 1e-12);
    entries.insert(entries.end(), 5, attempt(true, 2));
    EXPECT_FALSE(standing(entries, "torso", "liver", 3).steady);
    entries.push_back(attempt(true, 2));
    EXPECT_TRUE(standing(entries, "torso", "liver", 3).steady);
    // It never falls below 0: a bad beginning is forgiven.
    entries.assign(20, attempt(false, 9));
    EXPECT_EQ(standing(entries, "torso", "liver", 3).cusum, 0);
    for (ProgressEntry& entry : entries) {
        entry.passed = true;
        entry.seed = seed_with_difficulty(9, -1);
    }
    EXPECT_EQ(standing(entries, "torso", "liver", 3).cusum, 0);  // easier ones do not count
}

}  // namespace
}  // namespace sonocase::runtime
