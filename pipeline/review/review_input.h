// SPDX-License-Identifier: Apache-2.0

// The input of a review: session, bundle, exercise and score.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/exercise/exercise_texts.h"
#include "formats/progress_book/progress_book.h"
#include "formats/recording/sequence.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"
#include "formats/words/catalogue.h"

namespace sonocase::pipeline::inline review {

struct ReviewOptions {
    std::string exercise;  // name in the bundle, or a TOML file; empty: the one the session names
    std::string progress_path;            // empty: no comparison with earlier sessions
    int width_px = 640, height_px = 480;  // of a 3-D view
    int threads = 0;
    std::string language = "en";  // of the page: a code or a locale, as find_language() takes it
};

struct ReviewInput {
    std::string session_path;
    Session session;
    CaseBundle bundle;
    Exercise exercise;
    ExerciseTexts texts;  // of the exercise, in the language of the page
    SessionScore score;
    Sequence pictures;                   // frames that the player kept; empty if it kept none
    std::vector<ProgressEntry> earlier;  // of this trainee and exercise, before this session
    std::vector<Message> warnings;       // whole sentences
    const Language* language = &languages().front();  // of the page

    std::string words(std::string_view english) const { return language->words(english); }
};

Result<ReviewInput> load_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const ReviewOptions& options);

struct ReviewedExercise {
    Exercise exercise;
    std::vector<ExerciseTexts> texts;  // in other languages
};

// What of the bundle and of the exercise that was found is not the session's own: another case,
// another exercise than the one that was recorded, or one that was changed since.
std::vector<Message> mismatch_warnings(const SessionHeader& header,
                                       const CaseBundle& bundle,
                                       const std::string& wanted,
                                       const Exercise& exercise);

// Returns the exercise of that name in the bundle, or of that TOML file, or a free scan if there is
// neither.
Result<ReviewedExercise> find_review_exercise(const CaseBundle& bundle,
                                              const std::string& wanted,
                                              const std::string& named_by_session,
                                              std::vector<Message>& warnings);

}  // namespace sonocase::pipeline::inline review
