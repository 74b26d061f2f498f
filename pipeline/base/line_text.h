// SPDX-License-Identifier: Apache-2.0

// One line of a report, formatted like printf; cut to 499 characters.
#pragma once

#include <cstdio>
#include <string>

namespace sonocase::pipeline {

inline std::string text(const char* format, auto... values) {
    char line[500];
    std::snprintf(line, sizeof line, format, values...);
    return line;
}

}  // namespace sonocase::pipeline
