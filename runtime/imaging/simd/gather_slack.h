// SPDX-License-Identifier: Apache-2.0

// Vector look-ups (gathers) read four bytes at a time.
#pragma once

#include <cstddef>

namespace sonocase::runtime {

// Every buffer that such a look-up touches ends with this much slack.
inline constexpr std::size_t kGatherSlack = 4;

}  // namespace sonocase::runtime
