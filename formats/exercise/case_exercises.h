// SPDX-License-Identifier: Apache-2.0

// The exercises that a case brings, ready to be played.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/exercise/exercise_texts.h"

namespace sonocase {

struct CaseExercises {
    std::vector<Exercise> exercises;   // at least one: without any, a free scan
    std::vector<std::string> digests;  // of each exercise's text; a free scan has none
    std::vector<Message> warnings;     // one per exercise that does not parse and is left out
};

// where: names the bundle in warnings.
CaseExercises exercises_of(const CaseBundle& bundle, const std::string& where);

// What a trainee reads of a case's exercise in other languages, for texts_in(); none where it is
// not one of the bundle or has no such tables.
std::vector<ExerciseTexts> texts_of_exercise(const CaseBundle& bundle, const std::string& exercise);

// The title that the recipe gives the case; its name where it gives none.
std::string case_title(const CaseManifest& manifest);

// A free scan of any bundle: the probe starts above the middle of its volume.
Exercise free_scan(const CaseBundle& bundle);

}  // namespace sonocase
