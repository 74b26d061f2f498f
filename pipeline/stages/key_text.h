// SPDX-License-Identifier: Apache-2.0

// Numbers as texts for the keys of stages: exact, the same everywhere.
#pragma once

#include <cstdio>
#include <initializer_list>
#include <string>

namespace sonocase::pipeline {

// "text 1.5 0.10000000000000001": every number to its last bit.
inline std::string key_text(std::string text, std::initializer_list<double> values) {
    for (const double value : values) {
        char digits[40];
        std::snprintf(digits, sizeof digits, " %.17g", value);
        text += digits;
    }
    return text;
}

}  // namespace sonocase::pipeline
