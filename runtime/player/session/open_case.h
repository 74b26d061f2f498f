// SPDX-License-Identifier: Apache-2.0

// A bundle opened for playing, with its exercises parsed.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

struct OpenCase {
    std::string path;
    StreamedBundle bundle;
    std::vector<Exercise> exercises;                   // at least one: without any, a free scan
    std::vector<std::string> exercise_digests;         // of their TOML; may be shorter
    std::vector<std::string> exercise_files;           // empty name: in the bundle; may be shorter
    std::shared_ptr<const PhysicalTextures> textures;  // null: each renderer makes its own
    std::vector<std::string> warnings;                 // whole sentences
};

// With the exercises of the bundle come those of the folder FILE.exercises beside it, where
// educators keep their own. Exercises that do not parse are left out and named in `warnings`. On
// the heap, because renderer and skin point into it. Errors: a file that cannot be read or is not a
// bundle.
Result<std::unique_ptr<OpenCase>> open_case(const std::string& path);

// An Error after a part of the bundle that a frame needed turned out to be damaged. Constant time,
// without allocation while nothing is damaged; for the frame loop.
Status bundle_health(const OpenCase& open);

// Index of the exercise of that name, or an Error that lists the names; "" means the first.
Result<int> find_exercise(const OpenCase& open, const std::string& name);

// The same; but a name that ends in .toml is a file whose exercise is added to those of the case,
// in place of one of the same name. Its places are in the frame `mannequin`. Errors: also a file
// that cannot be read or parsed, or that is written for a CT, and targets outside the body.
Result<int> choose_or_load_exercise(OpenCase& open, const std::string& name_or_file);

}  // namespace sonocase::runtime
