// SPDX-License-Identifier: Apache-2.0

// Text in the HTML and SVG that this program writes.
#pragma once

#include <string>
#include <string_view>

namespace sonocase::pipeline {

// The text with the five special characters of markup escaped; suitable for attributes as well.
std::string escaped_html(std::string_view text);

}  // namespace sonocase::pipeline
