// SPDX-License-Identifier: Apache-2.0

// A registration as one JSON file: what `sonocase register` writes and `map` and `resample` read.
// docs/format.md, part 4.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "formats/registration/registration.h"

namespace sonocase {

Result<Registration> parse_registration(std::string_view json, const std::string& where);
std::string format_registration(const Registration& registration);

}  // namespace sonocase
