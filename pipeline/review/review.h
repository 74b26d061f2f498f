// SPDX-License-Identifier: Apache-2.0

// A review of a session as a page, with its plots as inline SVG.
#pragma once

#include <string>
#include <vector>

#include "pipeline/review/review_input.h"
#include "pipeline/review/session_views.h"

namespace sonocase::pipeline::inline review {

// The session over time: bars for probe on skin and needle in tissue, marks for events, and one
// lane each for inserted length, tip to target, tip to scan plane and the part of the needle in the
// beam.
std::string timeline_svg(const ReviewInput& input);

// The course of a score over this trainee's sessions of the exercise, ending with this one; empty
// if there are no earlier ones.
std::string progress_svg(const ReviewInput& input, const std::string& metric);

// The review as one self-contained HTML page: pictures and plots are embedded. Its template is
// review_page.html.
std::string review_page(const ReviewInput& input, const std::vector<SessionView>& views);

// Loads, scores, renders and writes DIR/review.html and DIR/scores.json. Views that could not be
// rendered (no display) are left out with a warning in the page. seen: receives what was loaded
// and scored, for callers that need it.
Result<StageReport> make_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const std::string& folder,
                                const ReviewOptions& options,
                                ReviewInput* seen = nullptr);

}  // namespace sonocase::pipeline::inline review
