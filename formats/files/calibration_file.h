// SPDX-License-Identifier: Apache-2.0

// A calibration on disk (formats/calibration/calibration.h).
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/calibration/calibration.h"

namespace sonocase {

Result<Calibration> load_calibration(const std::string& path);
Status save_calibration(const Calibration& calibration, const std::string& path);

}  // namespace sonocase
