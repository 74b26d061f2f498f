// SPDX-License-Identifier: Apache-2.0

// Text: lines of reports, and rows of CSV, TSV or blank-separated files.
#pragma once

#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/text/lower_case.h"  // for those who read tables

namespace sonocase::pipeline::inline base {

// One line of a report, formatted like printf; cut to 499 characters.
inline std::string text(const char* format, auto... values) {
    char line[500];
    std::snprintf(line, sizeof line, format, values...);
    return line;
}

// A row of a file and the line that it stands in.
struct TextRow {
    int line = 0;  // 1 is the first
    std::vector<std::string> cells;
};

// Splits at ';', tab or ',', the first of these that the first row has, but not at tabs if cells
// would contain blanks; otherwise at blanks and tabs. Removes quotes and a byte order mark; leaves
// out empty lines and lines that start with '#' or "//". With ';' or a tab as separator, a comma
// between digits is a decimal comma.
std::vector<TextRow> split_rows(std::string_view text);

// The cells of one line, as split_rows has them: at `separator`, where ' ' stands for blanks and
// tabs.
std::vector<std::string> split_line(std::string_view line, char separator);
// ';', tab, ',' or ' ': the separator of the line.
char separator_of(std::string_view line);

// Done for UTF-8, with or without a byte order mark. An error names the line of the first byte that
// is none, or says that the text is UTF-16, and how to save it.
Status expect_utf8(std::string_view text, const std::string& where);

// The whole cell as a number; empty if it is not a number. "nan" and "inf" count as numbers.
std::optional<double> number_in(std::string_view cell);

// Without white space at either end; a view of `text`.
std::string_view trimmed(std::string_view text);

}  // namespace sonocase::pipeline::inline base
