// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/error_budget.h"

#include <cmath>
#include <limits>
#include <optional>
#include <string_view>

namespace sonocase::pipeline::inline exporting {

namespace {

std::optional<double> measure_of(std::span<const StageReport> stages,
                                 std::string_view stage,
                                 std::string_view name) {
    for (const StageReport& report : stages) {
        if (report.stage != stage) continue;
        for (const Measure& measure : report.measures)
            if (measure.name == name && std::isfinite(measure.value)) return measure.value;
    }
    return std::nullopt;
}

}  // namespace

ErrorBudget error_budget(std::span<const StageReport> stages) {
    ErrorBudget budget;
    const auto add = [&](const char* stage, const char* cause, double mm, const char* basis) {
        budget.entries.push_back({stage, cause, mm, basis});
        if (std::isfinite(mm)) budget.known_mm = std::hypot(budget.known_mm, mm);
    };
    if (const auto voxel = measure_of(stages, stage_names::kImport, "voxel_volume_mm3"))
        add(stage_names::kImport, "surfaces between the voxels of the CT",
            kSampledShare * std::cbrt(*voxel),
            "a tenth of its voxel, as measured on the analytic torso");
    if (const auto median = measure_of(stages, stage_names::kWarp, "skin_median_mm")) {
        add(stage_names::kWarp, "skin beside the mannequin", *median,
            "median of this case's readings");
        const auto inside = measure_of(stages, stage_names::kWarp, "predicted_interior_mm");
        if (inside && *inside > 0)
            add(stage_names::kWarp, "organs along the skin and deep in the body", *inside,
                "what this case's readings leave open; landmarks far apart lower it");
        else
            add(stage_names::kWarp, "organs along the skin and deep in the body",
                std::numeric_limits<double>::quiet_NaN(), "the fit found no quadratic to judge by");
    }
    if (const auto voxel = measure_of(stages, stage_names::kResample, "voxel_mm"))
        add(stage_names::kResample, "surfaces between the voxels of the case",
            kCookedShare * *voxel, "a twentieth of its voxel, as measured on the analytic torso");
    return budget;
}

}  // namespace sonocase::pipeline::inline exporting
