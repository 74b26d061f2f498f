// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/memory_need.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/line_text.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/cook/case_size.h"
#include "pipeline/stage/stage_plan.h"

namespace sonocase::pipeline {

MemoryNeed memory_need(const Recipe& recipe, double limit_mb) {
    const double limit = limit_mb > 0 ? limit_mb : machine_memory_mb();
    MemoryNeed need;
    need.size = case_size(recipe);
    for (const PlannedStage& stage : plan_stages(recipe, {})) {
        if (stage.is_step()) continue;
        const StageCost& cost = stage.descriptor->cost;
        const double all = cost.memory_mb(need.size);
        const double mb =
            all <= limit ? all : std::max<double>(cost.least_mb(need.size), std::min(all, limit));
        if (mb <= need.mb) continue;
        need.mb = mb;
        need.stage = stage.stage;
    }
    return need;
}

Status check_memory(const MemoryNeed& need, double limit_mb) {
    const bool given = limit_mb > 0;
    const double limit = given ? limit_mb : machine_memory_mb();
    if (need.mb <= limit) return Done{};
    return Error{text("stage '%s' needs about %.0f MB for %.1f million voxels of the label map and "
                      "%.1f million cooked ones, and %.0f MB are %s",
                      need.stage.c_str(), need.mb, need.size.label_voxels,
                      need.size.cooked_voxels + need.size.region_voxels, limit,
                      given ? "allowed" : "in this machine"),
                 "--memory-mb",
                 "a larger resample.voxel_mm, a coarser or cropped label map, or more memory"};
}

}  // namespace sonocase::pipeline
