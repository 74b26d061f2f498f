// SPDX-License-Identifier: Apache-2.0

// The review as one self-contained HTML page: pictures and plots are embedded. Its template is
// review_page.html.
#pragma once

#include <string>
#include <vector>

#include "pipeline/review/review_input.h"
#include "pipeline/review/session_views.h"

namespace sonocase::pipeline {

std::string review_page(const ReviewInput& input, const std::vector<SessionView>& views);

// Loads, scores, renders and writes DIR/review.html and DIR/scores.json. Views that could not be
// rendered (no display) are left out with a warning in the page. seen: takes what was loaded and
// scored, for callers that go on with it.
Result<StageReport> make_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const std::string& folder,
                                const ReviewOptions& options,
                                ReviewInput* seen = nullptr);

}  // namespace sonocase::pipeline
