// SPDX-License-Identifier: Apache-2.0

// Difficulty that follows the trainee: which exercise of a case comes next, and how hard its next
// attempt is.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/progress_book/progress_book.h"

namespace sonocase::runtime::inline player_app {

struct KnownExercise {
    std::string name;
    int difficulty = 1;  // 1 easy .. 5 hard
    int mastery = 3;     // passes in a row
};

inline constexpr int kTooHard = 3;  // attempts in a row that were not passed

// Index into `exercises`; 0 for a trainee who has tried none of them. The exercise tried last stays
// until it is mastered: then comes the easiest one that is not mastered, of at least its
// difficulty, or else of any. After kTooHard failures in a row comes the hardest of the easier ones
// that is not mastered, where there is one. When all are mastered: the hardest.
// history: of the trainee, oldest first; all cases and exercises.
int next_exercise_index(std::span<const KnownExercise> exercises,
                        std::span<const ProgressEntry> history,
                        const std::string& case_name);

// Difficulty within an exercise (formats/scoring/draw_attempt.h) of the next attempt at practice:
// as written at first, one harder after a pass, one easier after two failures in a row at the same
// difficulty.
int next_difficulty(std::span<const ProgressEntry> history,
                    const std::string& case_name,
                    const std::string& exercise);

}  // namespace sonocase::runtime::inline player_app
