// SPDX-License-Identifier: Apache-2.0

// review_page.html, embedded at configure time. Internal to pipeline/review.
#pragma once

#include <string_view>

namespace sonocase::pipeline {

extern const std::string_view kReviewPageHtml;

}  // namespace sonocase::pipeline
