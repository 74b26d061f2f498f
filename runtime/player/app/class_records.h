// SPDX-License-Identifier: Apache-2.0

// How far a class's marks can be trusted, from what was recorded.
//
// Alpha (L. J. Cronbach, Psychometrika 16:297, 1951) over a trainee's first attempts at an
// exercise, each an item:
//     alpha = k / (k - 1) (1 - sum of the items' variances / variance of the trainees' sums)
// 0.8 or more is usual where marks decide. Below 0 it says that attempts disagree.
//
// Pass mark by contrasting groups (S. A. Livingston, M. J. Zieky, Passing Scores, 1982): where the
// normal curves of two groups' results cross, between their means; each group counts the same. The
// groups are those whom the educator calls experts, and everyone else at the first attempt.
#pragma once

#include <cmath>
#include <map>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "formats/progress_book/progress_book.h"
#include "formats/scoring/course_standing.h"

namespace sonocase::runtime::inline player_app {

inline constexpr int kAlphaAttempts = 3;  // of each trainee that count for alpha

// rows: one per trainee, # items each, at least two. NaN: fewer than two rows, or no spread at all.
double cronbach_alpha(const std::vector<std::vector<double>>& rows);

struct ContrastingGroups {
    double mark = NAN;             // NaN: a group has fewer than two results, or they do not differ
    double experts_failed = 0;     // share of the experts' results that miss the mark
    double novices_passed = 0;     // share of the novices' that reach it
    int experts = 0, novices = 0;  // results
};
// Less is better.
ContrastingGroups contrasting_groups(std::span<const double> experts,
                                     std::span<const double> novices);

// The same exercise on two cases is two.
struct ClassExercise {
    std::string case_name, name;

    bool operator==(const ClassExercise&) const = default;
    bool operator<(const ClassExercise& other) const {
        return std::tie(case_name, name) < std::tie(other.case_name, other.name);
    }
};

struct ExerciseReliability {
    double alpha = NAN;
    int trainees = 0;  // that alpha rests on
    ContrastingGroups groups;
};
// The reliability of final_tip_to_target_mm. entries: oldest first.
ExerciseReliability exercise_reliability(std::span<const ProgressEntry> entries,
                                         const ClassExercise& exercise,
                                         const std::set<std::string>& experts);

// What an educator sees: every trainee's standing with every exercise, from the progress book of
// this machine.

// Who needs help: the first with several attempts and no pass.
struct NeedsHelp {
    std::string trainee;  // empty: nobody
    ClassExercise exercise;
    int attempts = 0;
};

// A line of an exercise's checklist over several attempts.
struct ChecklistRow {
    std::string name;
    bool critical = false;
    int ticked = 0, attempts = 0;
    bool last = false;  // ticked in the last of them
};

struct ClassRecords {
    std::vector<ProgressEntry> entries;    // oldest first
    std::vector<std::string> trainees;     // those that occur, sorted
    std::vector<ClassExercise> exercises;  // likewise
    std::map<ClassExercise, ExerciseReliability> reliability;
    NeedsHelp help;
    std::map<std::string, CourseStanding> course;  // of each trainee; empty: there is no course

    Standing standing(const std::string& trainee, const ClassExercise& exercise) const;
    // By the list of the last attempt, in its order; empty: the exercise has no list. trainee
    // empty: of everyone.
    std::vector<ChecklistRow> checklist(const std::string& trainee,
                                        const ClassExercise& exercise) const;
    // Tip to target, mm, of each attempt that has it, oldest first.
    std::vector<double> curve(const std::string& trainee, const ClassExercise& exercise) const;
};

// experts: trainees whom the educator calls so.
// course: whose standings are wanted, on the day `today`; null: none.
ClassRecords make_class_records(std::vector<ProgressEntry> entries,
                                const std::set<std::string>& experts = {},
                                const Course* course = nullptr,
                                const std::string& today = "");

// Statements of the Experience API 1.0.3, one per attempt, as a JSON array. Trainees are accounts
// of this machine, not mail addresses.
std::string xapi_json(std::span<const ProgressEntry> entries);

}  // namespace sonocase::runtime::inline player_app
