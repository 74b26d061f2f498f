// SPDX-License-Identifier: Apache-2.0

// A machine by its name or on disk (formats/machine/machine.h).
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/machine/machine.h"

namespace sonocase {

// name_or_path: a built-in machine's name, else a TOML file; a path has a '/' or ends in ".toml".
// Errors: no such name (with the nearest) or file, and those of parse_machine().
Result<Machine> load_machine(const std::string& name_or_path);

}  // namespace sonocase
