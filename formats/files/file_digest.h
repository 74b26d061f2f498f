// SPDX-License-Identifier: Apache-2.0

// The digest of a whole file (formats/base/digest.h).
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase {

Result<std::string> digest_of_file(const std::string& path);

}  // namespace sonocase
