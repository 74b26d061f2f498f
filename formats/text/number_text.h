// SPDX-License-Identifier: Apache-2.0

// Numbers to text and back, the same under every locale.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace sonocase {

// The whole of `text` must be the number; blanks at either end are allowed. "nan", "inf" and "-inf"
// are accepted: the caller decides whether they are allowed.
bool parse_number(std::string_view text, double& value);
bool parse_number(std::string_view text, std::int64_t& value);

// Shortest text that reads back as the same double.
void append_number(std::string& out, double value);
std::string number_text(double value);
// For people: `digits` significant digits, or a fixed number of decimals.
std::string number_text(double value, int digits);
std::string fixed_text(double value, int decimals);

std::string_view trimmed(std::string_view text);  // without blanks at either end

}  // namespace sonocase
