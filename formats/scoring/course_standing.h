// SPDX-License-Identifier: Apache-2.0

// How a trainee stands with an exercise and in a course (formats/exercise/course.h), by the
// attempts that were kept: one rule for window, class and page.
#pragma once

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "formats/exercise/course.h"
#include "formats/scoring/attempt_result.h"
#include "formats/scoring/progress_entry.h"

namespace sonocase {

inline constexpr std::size_t kMaxTrend = 12;  // attempts

// earlier: attempts of the same trainee at the same exercise, oldest first, this one left out.
void add_trend(std::span<const ProgressEntry> earlier,
               const SessionScore& score,
               AttemptResult& result);

inline constexpr double kSteadyCusum = 2;

// How a trainee stands with an exercise.
struct Standing {
    int attempts = 0, passes = 0;
    // Passes at the end of the list; those of attempts easier than the exercise as written do not
    // count.
    int in_a_row = 0;
    bool mastered = false;  // once `mastery` passes in a row
    // Learning-curve CUSUM: the sum, never below 0, of the log likelihood ratios of failing 1
    // attempt in 10 to failing 3 in 10, over the attempts that count; steady once it has reached
    // kSteadyCusum. After Biau and Porcher, Stat Med 2010, doi 10.1002/sim.3947; the two rates and
    // the limit are assumed. Eight passes in a row reach it; of those who fail 3 in 10, 27 % do so
    // within 20 attempts, of those who fail 1 in 10, 89 %.
    double cusum = 0;
    bool steady = false;
    std::string mastered_at, steady_at;  // start of the attempt that made it so
    double best_mm = -1;  // final_tip_to_target_mm of the best attempt; negative: none
};
Standing standing(std::span<const ProgressEntry> entries,
                  const std::string& case_name,
                  const std::string& exercise,
                  int mastery);

struct ModuleStanding {
    int option = -1;         // answered; -1: not yet
    bool open = false;       // the modules before it are passed
    Standing attempts;       // those that count for the gate
    double measured = NAN;   // the practised measure, in the last attempt
    bool in_limits = false;  // `measured` is
    bool passed = false;
    // Days as YYYY-MM-DD; empty: none.
    std::string passed_on, due_on, kept_on;
    bool due = false;  // the day has come, and no pass since
};

struct CourseStanding {
    std::vector<ModuleStanding> modules;  // # modules
    int passed = 0, due = 0;
    int next = -1;  // first the module that is due, then the first not passed; -1: none
};

// history: of the trainee, oldest first. today: as it begins an ISO 8601 time.
CourseStanding course_standing(const Course& course,
                               std::span<const ProgressEntry> history,
                               std::span<const CourseAnswer> answers,
                               const std::string& today);

}  // namespace sonocase
