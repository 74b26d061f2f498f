// Content hashes of a recipe's inputs.
#pragma once

#include <string>

#include "formats/result.h"

namespace sonocase::pipeline {

// Of a file's bytes; of a folder, of the names and bytes of all files in it, at any depth.
Result<std::string> digest_of_input(const std::string& path);

}  // namespace sonocase::pipeline
