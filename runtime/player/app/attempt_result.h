// SPDX-License-Identifier: Apache-2.0

// What the page after an attempt says: passed or not, five results with what was needed, the trend
// of the one that matters most now, and one sentence on what to do differently. Words are English
// keys of the catalogue (runtime/player/words/words.h).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/progress_book/progress_book.h"
#include "formats/scoring/session_score.h"

namespace sonocase::runtime::inline player_app {

inline constexpr std::size_t kMaxResults = 5;
inline constexpr std::size_t kMaxTrend = 12;  // attempts

struct ResultRow {
    std::string metric;  // of metric_table()
    const char* title = "";
    double value = 0;        // NaN: not defined for this attempt
    bool has_limit = false;  // false: no pass mark, shown without verdict
    bool at_least = false;   // the limit is a lower one
    double limit = 0;
    bool reached = true;
    // Places on a scale from 0 to 1 on which both value and limit lie.
    float value_at = 0, limit_at = 0;
};

struct AttemptResult {
    // false: the exercise has neither marks nor a procedure, and there is no verdict
    bool has_marks = false;
    bool passed = false;
    int marks = 0, marks_reached = 0;
    std::vector<ResultRow> rows;  // at most kMaxResults; marks first, missed ones before others
    const char* advice = "";      // a sentence for the worst miss; empty: none
    std::string trend_metric;     // empty: there are no marks
    std::vector<double> trend;    // of that metric, oldest first, this attempt last; finite
};

// earlier: attempts of the same trainee at the same exercise, oldest first, this one left out.
AttemptResult attempt_result(const SessionScore& score, std::span<const ProgressEntry> earlier);

// "4.2 mm", "61 %", "1:47", "3"; a dash where it is not finite. Shares are shown in per cent.
std::string metric_words(const std::string& metric, double value);

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

}  // namespace sonocase::runtime::inline player_app
