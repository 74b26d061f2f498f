// SPDX-License-Identifier: Apache-2.0

// Rows of a CSV, TSV or blank-separated text. Internal to import.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase::pipeline {

struct TextRow {
    int line = 0;  // 1 is the first
    std::vector<std::string> cells;
};

// Splits at ';', tab or ',' (the first of these that the first row has; no tab where cells would
// hold blanks), else at blanks and tabs. Quotes and
// a byte order mark are taken off, empty lines and lines that start with '#' or "//" left out. With
// ';' or a tab, a comma between digits is a decimal comma.
std::vector<TextRow> split_rows(std::string_view text);

// The whole cell as a number; nothing where it is none. "nan" and "inf" are numbers.
std::optional<double> number_in(std::string_view cell);

std::string lower_case(std::string_view text);

}  // namespace sonocase::pipeline
