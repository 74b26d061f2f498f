// SPDX-License-Identifier: Apache-2.0

// Exam sets: exercises of a case that are taken one after the other as an exam, each once. Which
// ones belong to it is kept in the settings, by case.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

bool in_exam_set(const App& app, const std::string& exercise);
void toggle_in_exam_set(App& app, const std::string& exercise);
int exam_set_size(const App& app);  // of the open case, exercises that it still has

// Begins with the first exercise. Does nothing for an empty set or while an attempt runs.
void start_exam_set(App& app);
// After an attempt of the set: notes its result once.
void note_exam_result(App& app);
// The next exercise of the set, or its end.
void go_on_with_exam_set(App& app);
inline bool exam_set_runs(const App& app) {
    return !app.scan.exam_set.exercises.empty();
}
// "Exercise 2 of 3", or at the end "Exam finished: 2 of 3 passed."
std::string exam_set_words(const App& app);

}  // namespace sonocase::runtime
