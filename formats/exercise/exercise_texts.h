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
    // Of its procedure, by name; in the order of the file, or of the procedure (texts_in()).
    struct Step {
        std::string name, title, instruction;
    };
    struct Item {
        std::string name, title, question;
        std::vector<std::string> options;  // as many as the item has, or none
    };
    std::vector<Step> steps;
    std::vector<Item> items;
};

// In alphabetical order of their languages. Errors: those of parse_exercise().
Result<std::vector<ExerciseTexts>> parse_exercise_texts(std::string_view toml,
                                                        const std::string& where);

// All texts in a language, each as the exercise itself has it where `texts` lack it; a step and an
// item for each of the procedure, in its order. An exercise without a title is called by its name.
ExerciseTexts texts_in(const Exercise& exercise,
                       const std::vector<ExerciseTexts>& texts,
                       std::string_view language);

}  // namespace sonocase
