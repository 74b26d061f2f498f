// SPDX-License-Identifier: Apache-2.0

// The instruction set that vectorised kernels run on. Every kernel is compiled for several, and
// each call is told which one to use: a renderer's choice is its own and depends on no state of the
// process. All of them give the same pixels.
#pragma once

#include <cstddef>
#include <vector>

namespace sonocase::runtime {

// Vector look-ups (gathers) read four bytes at a time. Every buffer that they touch ends with this
// much slack.
inline constexpr std::size_t kGatherSlack = 4;

struct SimdTarget {
    const char* name = "";  // Highway's: "AVX3", "AVX2", "SSE4", ...
    std::size_t index = 0;  // of a kernel's table: HWY_DISPATCH_TABLE(kernel)[index]
};

// The targets that this machine and this build have, best first; never empty.
std::vector<SimdTarget> available_simd_targets();

}  // namespace sonocase::runtime
