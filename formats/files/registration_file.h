// SPDX-License-Identifier: Apache-2.0

// A registration on disk: what `sonocase register` writes and `map` and `resample` read.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/registration/registration.h"

namespace sonocase {

Result<Registration> load_registration(const std::string& path);
Status save_registration(const Registration& registration, const std::string& path);

}  // namespace sonocase
