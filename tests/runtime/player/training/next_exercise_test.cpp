// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/next_exercise.h"

#include <gtest/gtest.h>

#include "formats/scoring/draw_attempt.h"

namespace sonocase::runtime {
namespace {

const std::vector<KnownExercise> kExercises = {
    {"hard", 4, 2}, {"easy", 1, 2}, {"middle", 2, 2}, {"hardest", 5, 2}};

std::vector<ProgressEntry> history(const std::string& words) {
    // "e+" is a pass of "easy", "m-" a failure of "middle", "h" hard, "x" hardest.
    std::vector<ProgressEntry> all;
    for (std::size_t i = 0; i + 1 < words.size(); i += 2) {
        ProgressEntry entry;
        entry.case_name = "torso";
        entry.exercise = words[i] == 'e'   ? "easy"
                         : words[i] == 'm' ? "middle"
                         : words[i] == 'h' ? "hard"
                                           : "hardest";
        entry.passed = words[i + 1] == '+';
        all.push_back(entry);
    }
    return all;
}

std::string next(const std::string& words) {
    const int index = next_exercise_index(kExercises, history(words), "torso");
    return kExercises[index].name;
}

TEST(NextExercise, GoesUpAfterMasteryAndDownAfterThreeFailures) {
    EXPECT_EQ(next(""), "hard");  // the first of the case
    EXPECT_EQ(next("e+"), "easy");
    EXPECT_EQ(next("e+e+"), "middle");
    EXPECT_EQ(next("e+e+m-m-"), "middle");
    EXPECT_EQ(next("h-h-h-"), "middle");
    EXPECT_EQ(next("m+m+h-h-h-"), "easy");
    EXPECT_EQ(next("e-e-e-"), "easy");  // nothing is easier
    EXPECT_EQ(next("h+h+"), "hardest");
    EXPECT_EQ(next("x+x+h+h+"), "easy");  // what was left out
    EXPECT_EQ(next("e+e+m+m+h+h+x+x+"), "hardest");
    EXPECT_EQ(next_exercise_index(kExercises, history("e+e+"), "another case"), 0);
    EXPECT_EQ(next_exercise_index({}, history("e+e+"), "torso"), 0);
}

// "+" a pass, "-" a failure of "easy", each played at the difficulty that was proposed.
int difficulty_after(const std::string& results) {
    std::vector<ProgressEntry> all;
    for (const char result : results) {
        ProgressEntry entry;
        entry.case_name = "torso";
        entry.exercise = "easy";
        entry.passed = result == '+';
        entry.seed = seed_with_difficulty(77, next_difficulty(all, "torso", "easy"));
        all.push_back(entry);
    }
    EXPECT_EQ(next_difficulty(all, "torso", "hard"), 0);
    EXPECT_EQ(next_difficulty(all, "another case", "easy"), 0);
    return next_difficulty(all, "torso", "easy");
}

TEST(NextDifficulty, RisesWithEachPassAndFallsAfterTwoFailures) {
    EXPECT_EQ(difficulty_after(""), 0);
    EXPECT_EQ(difficulty_after("+"), 1);
    EXPECT_EQ(difficulty_after("+++++"), kHardest);
    EXPECT_EQ(difficulty_after("-"), 0);
    EXPECT_EQ(difficulty_after("--"), -1);
    EXPECT_EQ(difficulty_after("---"), -1);
    EXPECT_EQ(difficulty_after("----"), -2);
    EXPECT_EQ(difficulty_after("----------"), kEasiest);
    EXPECT_EQ(difficulty_after("--+"), 0);
    EXPECT_EQ(difficulty_after("-+-"), 1);
    EXPECT_EQ(difficulty_after("+--"), 0);
}

// Attempts that were drawn anew as written, and those of before there were difficulties.
TEST(NextDifficulty, OfAttemptsAsWrittenBeginsThere) {
    ProgressEntry entry;
    entry.case_name = "torso";
    entry.exercise = "easy";
    entry.passed = true;
    const std::vector<ProgressEntry> exams(6, entry);
    EXPECT_EQ(next_difficulty(exams, "torso", "easy"), 1);
}

}  // namespace
}  // namespace sonocase::runtime
