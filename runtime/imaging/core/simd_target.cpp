// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/simd_target.h"

#include <hwy/highway.h>
#include <hwy/targets.h>

namespace sonocase::runtime {

std::vector<SimdTarget> available_simd_targets() {
    std::vector<SimdTarget> out;
    for (const std::int64_t id : hwy::SupportedAndGeneratedTargets()) {
#if HWY_IDE || ((HWY_TARGETS & (HWY_TARGETS - 1)) == 0)
        const std::size_t index = 0;  // compiled for one: its table has one entry
#else
        hwy::ChosenTarget only;
        only.Update(id);
        const std::size_t index = only.GetIndex();
#endif
        out.push_back({hwy::TargetName(id), index});
    }
    return out;
}

}  // namespace sonocase::runtime
