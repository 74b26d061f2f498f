// SPDX-License-Identifier: Apache-2.0

// Formatted sentences and small statistics for the reports. Internal to formats/calibrate.
#pragma once

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::calibrate {

inline constexpr double kDegree = 3.14159265358979323846 / 180;
// Median of the length of a 2- and of a 3-vector of unit normal components.
inline constexpr double kMedianLength2 = 1.1774100225154747;
inline constexpr double kMedianLength3 = 1.5381722544550522;

template <class... Args>
std::string text(const char* format, Args... args) {
    std::array<char, 512> line{};
    std::snprintf(line.data(), line.size(), format, args...);
    return line.data();
}

inline std::string axis_text(Vector3 a) {
    return text("(%.2f, %.2f, %.2f)", a.x, a.y, a.z);
}

inline double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace sonocase::calibrate
