// SPDX-License-Identifier: Apache-2.0

// Who does the work of a renderer, and on what.
#pragma once

#include "formats/base/jobs.h"
#include "runtime/imaging/host/host.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

// Workers and jobs outlive whatever is given them.
struct RenderContext {
    Workers& workers;       // for frames
    JobRunner& jobs;        // for tables, while a renderer is created
    SimdTarget simd;        // of the kernels
    Clock clock = nullptr;  // null: passes take 0 ms
};

}  // namespace sonocase::runtime
