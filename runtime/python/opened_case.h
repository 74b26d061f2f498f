// SPDX-License-Identifier: Apache-2.0

// A case as Python holds it: the bundle, its exercises, and whether it was closed. Nothing here
// knows Python.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/skin.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::python {

// Stays in place and is shared by its renderers, so that closing it frees nothing that a frame on
// another thread still reads.
struct OpenedCase {
    std::string path;
    StreamedBundle bundle;
    std::vector<Exercise> exercises;    // those that could be read
    std::vector<std::string> warnings;  // whole sentences, about those that could not
    std::atomic<bool> closed{false};
};

// Errors: a file that cannot be read or is not a bundle.
Result<std::shared_ptr<OpenedCase>> open_case(const std::string& path);

// An Error once the case is closed, or once a part of it that was needed turned out to be damaged.
Status usable(const OpenedCase& opened);

// The exercise of that name; "" means the first, and where the bundle holds none, a free scan.
Result<Exercise> exercise_named(const OpenedCase& opened, const std::string& name);

}  // namespace sonocase::python
