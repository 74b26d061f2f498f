// SPDX-License-Identifier: Apache-2.0

// What a trainee reads of an exercise, in other languages than its own: the tables [texts.de] and
// the like of its TOML.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/exercise/exercise.h"

namespace sonocase {

struct ExerciseTexts {
    std::string language;  // ISO 639-1
    std::string title, description;
    std::vector<std::string> hints;  // # hints of the exercise, or none
};

// In alphabetical order of their languages. Errors: those of parse_exercise().
Result<std::vector<ExerciseTexts>> parse_exercise_texts(std::string_view toml,
                                                        const std::string& where);

// Title, description and hints in a language, each as the exercise itself has it where `texts`
// lack it. An exercise without a title is called by its name.
ExerciseTexts texts_in(const Exercise& exercise,
                       const std::vector<ExerciseTexts>& texts,
                       std::string_view language);

}  // namespace sonocase
