// SPDX-License-Identifier: Apache-2.0

// Text in the HTML and SVG that this program writes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase::pipeline {

// The text with the five special characters of markup escaped; suitable for attributes as well.
std::string escaped_html(std::string_view text);

// For pictures inside a page: src="data:image/png;base64,...".
std::string base64(const std::vector<std::uint8_t>& bytes);

}  // namespace sonocase::pipeline
