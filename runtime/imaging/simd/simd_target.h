// SPDX-License-Identifier: Apache-2.0

// Which instruction set the vectorised kernels run on. Chosen at run time; tests force each in
// turn, because every one must give the same pixels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sonocase::runtime {

struct SimdTarget {
    std::string name;
    std::int64_t id = 0;
};

std::vector<SimdTarget> available_simd_targets();  // of this machine and this build, best first
void choose_simd_target();                         // before the first kernel runs
void force_simd_target(std::int64_t id);  // 0: back to the best. Not thread-safe: tests only.

}  // namespace sonocase::runtime
