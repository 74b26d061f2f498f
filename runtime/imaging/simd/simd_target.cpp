// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/simd/simd_target.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd_target.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
std::int64_t this_target() {
    return HWY_TARGET;
}
}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(this_target);

std::vector<SimdTarget> available_simd_targets() {
    std::vector<SimdTarget> out;
    for (const std::int64_t id : hwy::SupportedAndGeneratedTargets())
        out.push_back({hwy::TargetName(id), id});
    return out;
}

void choose_simd_target() {
    if (!hwy::GetChosenTarget().IsInitialized())
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

void force_simd_target(std::int64_t id) {
    hwy::SetSupportedTargetsForTest(id);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace sonocase::runtime
#endif
