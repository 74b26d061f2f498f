// SPDX-License-Identifier: Apache-2.0

// A bundle opened for playing, with its exercises parsed.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase::runtime {

struct OpenCase {
    std::string path;
    StreamedBundle bundle;
    std::vector<Exercise> exercises;    // at least one: a bundle without any gets free scanning
    std::vector<std::string> warnings;  // whole sentences
};

// Exercises that do not parse are left out and named in `warnings`. Heap-allocated, because
// renderer and skin point into it.
Result<std::unique_ptr<OpenCase>> open_case(const std::string& path);

// Index of the exercise of that name, or an Error that lists the names; "" is the first.
Result<int> find_exercise(const OpenCase& open, const std::string& name);

// A free scan of any bundle: the probe above its middle.
Exercise free_scan(const CaseBundle& bundle);

}  // namespace sonocase::runtime
