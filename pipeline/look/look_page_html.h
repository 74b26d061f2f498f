// SPDX-License-Identifier: Apache-2.0

// look_page.html, embedded at configure time. Internal to pipeline/look.
#pragma once

#include <string_view>

namespace sonocase::pipeline {

extern const std::string_view kLookPageHtml;

}  // namespace sonocase::pipeline
