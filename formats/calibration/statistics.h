// SPDX-License-Identifier: Apache-2.0

// Small statistics that the fits share. Internal to formats/calibration.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace sonocase::calibrate {

// Median length of a 2-vector and of a 3-vector whose components are standard normal: dividing a
// median residual by it gives a robust standard deviation per component.
inline constexpr double kMedianLength2 = 1.1774100225154747;
inline constexpr double kMedianLength3 = 1.5381722544550522;

// The upper median of an even number of values; at least one value.
inline double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace sonocase::calibrate
