// SPDX-License-Identifier: Apache-2.0

// Parts that panels are made of. Each draws into the current ImGui window; `packed` is a colour of
// runtime/display/theme.h. Headings and names of rows are shown as tr() has them.
#pragma once

#include <string>

#include "runtime/display/theme.h"

namespace sonocase::runtime::inline player_ui_parts {

void heading(const char* words);
void small_dim(const char* words);
void coloured(unsigned packed, const std::string& words);  // wrapped

// A name on the left and a value at the right edge.
void row(const char* name, const char* value, unsigned packed = colour::kText);
// format: of printf, for one double.
void row(const char* name, const char* format, double number, unsigned packed = colour::kText);
// Green once the distance is good_mm or less.
void row_distance(const char* name, double mm, double good_mm);

// A name, a slider and its value. A right click sets the middle of the range. True if it moved.
bool slider(
    const char* name, const char* id, double& value, double low, double high, const char* format);

// printf of one number.
std::string text(const char* format, double value);
// Minutes and seconds: "1:05".
std::string clock_words(double seconds);

}  // namespace sonocase::runtime::inline player_ui_parts
