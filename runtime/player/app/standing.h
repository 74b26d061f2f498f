// SPDX-License-Identifier: Apache-2.0

// What earlier attempts say: how a trainee stands with an exercise, and the trend of a score.
#pragma once

#include <span>
#include <string>

#include "formats/progress_book/progress_book.h"
#include "formats/scoring/attempt_result.h"

namespace sonocase::runtime::inline player_app {

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

}  // namespace sonocase::runtime::inline player_app
