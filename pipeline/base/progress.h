// SPDX-License-Identifier: Apache-2.0

// How a stage tells that it is alive. Stages print nothing; the program decides what to show.
#pragma once

#include <functional>
#include <string_view>

namespace sonocase::pipeline {

// fraction in [0, 1] of this stage, and what it is doing. Called from the calling thread only.
using Progress = std::function<void(double fraction, std::string_view doing)>;

inline void report_progress(const Progress& progress, double fraction, std::string_view doing) {
    if (progress) progress(fraction, doing);
}

}  // namespace sonocase::pipeline
