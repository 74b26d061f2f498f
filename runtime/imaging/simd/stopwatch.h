// SPDX-License-Identifier: Apache-2.0

// Time that passes took, for --stats and the governor. Changes no pixel.
#pragma once

#include <chrono>

namespace sonocase::runtime {

inline double milliseconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

}  // namespace sonocase::runtime
