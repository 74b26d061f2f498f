// SPDX-License-Identifier: Apache-2.0

// Text for HTML and SVG that this program writes.
#pragma once

#include <string>
#include <string_view>

namespace sonocase::pipeline {

// The text with the five characters that mean something in markup replaced; fit for attributes too.
std::string escaped_html(std::string_view text);

}  // namespace sonocase::pipeline
