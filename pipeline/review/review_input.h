// SPDX-License-Identifier: Apache-2.0

// The input of a review: session, bundle, exercise and score.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/progress_book/progress_book.h"
#include "formats/recording/sequence.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"

namespace sonocase::pipeline::inline review {

struct ReviewOptions {
    std::string exercise;  // name in the bundle, or a TOML file; empty: the one the session names
    std::string progress_path;            // empty: no comparison with earlier sessions
    int width_px = 640, height_px = 480;  // of a 3-D view
    int threads = 0;
};

struct ReviewInput {
    std::string session_path;
    Session session;
    CaseBundle bundle;
    Exercise exercise;
    SessionScore score;
    Sequence pictures;                   // frames that the player kept; empty if it kept none
    std::vector<ProgressEntry> earlier;  // of this trainee and exercise, before this session
    std::vector<std::string> warnings;   // whole sentences
};

Result<ReviewInput> load_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const ReviewOptions& options);

// Returns the exercise of that name in the bundle, or of that TOML file, or a free scan if there is
// neither.
Result<Exercise> find_review_exercise(const CaseBundle& bundle,
                                      const std::string& wanted,
                                      const std::string& named_by_session,
                                      std::vector<std::string>& warnings);

}  // namespace sonocase::pipeline::inline review
