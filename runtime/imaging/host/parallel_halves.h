// SPDX-License-Identifier: Apache-2.0

// Work on a scene's tables in two parts, while a renderer is created.
#pragma once

#include <cstddef>

#include "formats/base/jobs.h"

namespace sonocase::runtime {

// work(half, begin, end) for [0, count) in two parts, half 0 and 1, as two jobs of `jobs`.
template <class Work>
void parallel_halves(JobRunner& jobs, std::size_t count, const Work& work) {
    jobs.run(2, [&](std::size_t half) {
        work(half, half == 0 ? std::size_t{0} : count / 2, half == 0 ? count / 2 : count);
    });
}

}  // namespace sonocase::runtime
