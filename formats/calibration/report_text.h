// SPDX-License-Identifier: Apache-2.0

// Formatted sentences for the reports. Internal to formats/calibration.
#pragma once

#include <array>
#include <cstdio>
#include <string>

#include "formats/base/geometry.h"

namespace sonocase::calibrate {

// Formats as printf does; text beyond 511 characters is cut off.
template <class... Args>
std::string text(const char* format, Args... args) {
    std::array<char, 512> line{};
    std::snprintf(line.data(), line.size(), format, args...);
    return line.data();
}

inline std::string axis_text(Vector3 a) {
    return text("(%.2f, %.2f, %.2f)", a.x, a.y, a.z);
}

}  // namespace sonocase::calibrate
