// SPDX-License-Identifier: Apache-2.0

// Programs beside this one: pipeline and runtime do not link each other, so that what the runtime
// measures of itself is asked for by a command.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase::pipeline {

// What the program prints. arguments: as in a shell, quoted where needed. Error: it is not there
// (then `suites` are to be left out), or it fails.
Result<std::string> output_of_program_beside(const std::string& program,
                                             const std::string& arguments,
                                             const std::string& suites);

}  // namespace sonocase::pipeline
