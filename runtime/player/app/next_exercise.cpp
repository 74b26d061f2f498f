// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/next_exercise.h"

#include <algorithm>

#include "formats/scoring/course_standing.h"
#include "formats/scoring/draw_attempt.h"

namespace sonocase::runtime::inline player_app {
namespace {

// Failures at the end of the attempts at one exercise.
int failures_in_a_row(std::span<const ProgressEntry> history,
                      const std::string& case_name,
                      const std::string& exercise) {
    int count = 0;
    for (const ProgressEntry& entry : history) {
        if (entry.case_name != case_name || entry.exercise != exercise) continue;
        count = entry.passed ? 0 : count + 1;
    }
    return count;
}

}  // namespace

int next_exercise_index(std::span<const KnownExercise> exercises,
                        std::span<const ProgressEntry> history,
                        const std::string& case_name) {
    int last = -1;
    for (const ProgressEntry& entry : history) {
        for (std::size_t i = 0; i < exercises.size(); ++i) {
            if (entry.case_name == case_name && entry.exercise == exercises[i].name)
                last = static_cast<int>(i);
        }
    }
    if (last < 0) return 0;
    const KnownExercise& now = exercises[last];
    const auto mastered = [&](const KnownExercise& e) {
        return standing(history, case_name, e.name, e.mastery).mastered;
    };
    int next = -1;
    const auto better = [&](std::size_t i, bool harder) {
        const int best = next < 0 ? 0 : exercises[next].difficulty;
        return next < 0 ||
               (harder ? exercises[i].difficulty > best : exercises[i].difficulty < best);
    };
    if (!mastered(now)) {
        if (failures_in_a_row(history, case_name, now.name) < kTooHard) return last;
        for (std::size_t i = 0; i < exercises.size(); ++i) {
            if (exercises[i].difficulty < now.difficulty && !mastered(exercises[i]) &&
                better(i, true))
                next = static_cast<int>(i);
        }
        return next < 0 ? last : next;
    }
    for (const int min_difficulty : {now.difficulty, 0}) {
        for (std::size_t i = 0; i < exercises.size(); ++i) {
            if (exercises[i].difficulty >= min_difficulty && !mastered(exercises[i]) &&
                better(i, false))
                next = static_cast<int>(i);
        }
        if (next >= 0) return next;
    }
    for (std::size_t i = 0; i < exercises.size(); ++i) {
        if (better(i, true)) next = static_cast<int>(i);
    }
    return next;
}

int next_difficulty(std::span<const ProgressEntry> history,
                    const std::string& case_name,
                    const std::string& exercise) {
    constexpr int kFailures = 2;
    int difficulty = 0, failures = 0;
    for (const ProgressEntry& entry : history) {
        if (entry.case_name != case_name || entry.exercise != exercise) continue;
        const int played = attempt_difficulty(entry.seed);
        failures = entry.passed ? 0 : played == difficulty ? failures + 1 : 1;
        difficulty = played;
        if (entry.passed) {
            difficulty = std::min(played + 1, kHardest);
        } else if (failures >= kFailures) {
            difficulty = std::max(played - 1, kEasiest);
            failures = 0;
        }
    }
    return difficulty;
}

}  // namespace sonocase::runtime::inline player_app
