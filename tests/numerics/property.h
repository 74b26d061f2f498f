// SPDX-License-Identifier: Apache-2.0

// Property tests: rapidcheck chooses and shrinks a seed and prints it on failure. All shapes are
// made from it, so a failing case can be repeated with RC_PARAMS="seed=...".
#pragma once

#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cstdint>
#include <limits>

#include "support/random.h"

namespace sonocase::numerics {

inline constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

inline testing::Random random_case() {
    const auto seed = *rc::gen::arbitrary<std::uint32_t>().as("seed");
    return testing::Random(seed);
}

}  // namespace sonocase::numerics
