// SPDX-License-Identifier: Apache-2.0

// Text to a file or to standard output, as --stats asks for it.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase::runtime {

// path  "-" is standard output; any other file is written under a temporary name and renamed
Status write_text_output(const std::string& path, const std::string& text);

}  // namespace sonocase::runtime
