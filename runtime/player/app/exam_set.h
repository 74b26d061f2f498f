// SPDX-License-Identifier: Apache-2.0

// Exam sets: exercises of a case that are taken one after the other as an exam, each once. Which
// ones belong to it is kept in the settings, by case.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

bool in_exam_set(const Settings& settings, const CaseState& loaded, const std::string& exercise);
void toggle_in_exam_set(Settings& settings, const CaseState& loaded, const std::string& exercise);
// Exercises of the open case that belong to it.
int exam_set_size(const Settings& settings, const CaseState& loaded);

// Begins with the first exercise. Does nothing for an empty set or while an attempt runs.
void start_exam_set(PlayerState& player, CaseState& loaded, ScanState& scan);
// After an attempt of the set: notes its result once.
void note_exam_result(Training& training);
// The next exercise of the set, or its end.
void go_on_with_exam_set(PlayerState& player, CaseState& loaded, ScanState& scan);
// "Exercise 2 of 3", or at the end "Exam finished: 2 of 3 passed."
std::string exam_set_words(const ExamSet& set);

}  // namespace sonocase::runtime::inline player_app
