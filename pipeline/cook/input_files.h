// SPDX-License-Identifier: Apache-2.0

// Content hashes of a recipe's inputs.
#pragma once

#include <functional>
#include <string>

#include "formats/base/digest.h"
#include "formats/base/result.h"
#include "formats/files/file_digest.h"
#include "pipeline/stage/recipe.h"

namespace sonocase::pipeline {

// Of a file's bytes; of a folder, of the names and bytes of all files in it, at any depth.
// of_file hashes one file.
Result<std::string> digest_of_input(
    const std::string& path,
    const std::function<Result<std::string>(const std::string&)>& of_file = digest_of_file);

// digest  digest_of_input, or one that remembers. Error: a file that does not exist.
using DigestOfInput = std::function<Result<std::string>(const std::string& path)>;
Result<InputDigests> digest_inputs(const Recipe& recipe, const DigestOfInput& digest);

}  // namespace sonocase::pipeline
