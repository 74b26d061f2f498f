// SPDX-License-Identifier: Apache-2.0

// How a stage reports its progress. Stages print nothing; the program decides what to show.
#pragma once

#include <functional>
#include <string_view>

namespace sonocase::pipeline::inline base {

// fraction: how much of this stage is done, [0, 1]; doing: what it does now. Called only from the
// thread that called the stage.
using Progress = std::function<void(double fraction, std::string_view doing)>;

inline void report_progress(const Progress& progress, double fraction, std::string_view doing) {
    if (progress) progress(fraction, doing);
}

}  // namespace sonocase::pipeline::inline base
