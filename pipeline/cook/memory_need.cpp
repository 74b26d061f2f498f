// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/memory_need.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "pipeline/base/line_text.h"
#include "pipeline/cook/case_size.h"
#include "pipeline/stage/stage_plan.h"

namespace sonocase::pipeline {

MemoryNeed memory_need(const Recipe& recipe) {
    MemoryNeed need;
    need.size = case_size(recipe);
    for (const PlannedStage& stage : plan_stages(recipe, {})) {
        if (stage.is_step()) continue;
        const double mb = stage.descriptor->cost.memory_mb(need.size);
        if (mb <= need.mb) continue;
        need.mb = mb;
        need.stage = stage.stage;
    }
    return need;
}

double machine_memory_mb() {
    double limit = std::numeric_limits<double>::infinity();
    const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    if (pages > 0 && page > 0) limit = static_cast<double>(pages) * static_cast<double>(page) / 1e6;
    // Version 2 of control groups names one path below its root; "max" means no limit.
    std::ifstream groups("/proc/self/cgroup");
    std::string line, path;
    while (std::getline(groups, line)) {
        if (line.starts_with("0::/")) path = line.substr(3);
    }
    while (!path.empty()) {
        std::ifstream file("/sys/fs/cgroup" + path + "/memory.max");
        double bytes = 0;
        if (file >> bytes) limit = std::min(limit, bytes / 1e6);
        path.resize(path == "/" ? 0 : path.rfind('/'));
    }
    return limit;
}

Status check_memory(const MemoryNeed& need, double limit_mb) {
    const bool given = limit_mb > 0;
    const double limit = given ? limit_mb : machine_memory_mb();
    if (need.mb <= limit) return Done{};
    return Error{text("stage '%s' needs about %.0f MB for %.1f million voxels of the label map and "
                      "%.1f million cooked ones, and %.0f MB are %s",
                      need.stage.c_str(), need.mb, need.size.label_voxels, need.size.cooked_voxels,
                      limit, given ? "allowed" : "in this machine"),
                 "--memory-mb",
                 "a larger resample.voxel_mm, a coarser or cropped label map, or more memory"};
}

}  // namespace sonocase::pipeline
