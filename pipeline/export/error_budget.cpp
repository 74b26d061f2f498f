// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/error_budget.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>

#include "formats/exercise/exercise.h"
#include "pipeline/base/text.h"

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
                std::numeric_limits<double>::quiet_NaN(),
                "too few readings have a counterpart to judge by");
    }
    if (const auto voxel = measure_of(stages, stage_names::kResample, "voxel_mm"))
        add(stage_names::kResample, "surfaces between the voxels of the case",
            kCookedShare * *voxel, "a twentieth of its voxel, as measured on the analytic torso");
    return budget;
}

std::vector<UnknownPlace> unknown_places(std::span<const StageReport> stages) {
    std::vector<UnknownPlace> places;
    for (const StageReport& report : stages) {
        if (report.stage != stage_names::kWarp) continue;
        for (const MeasureGroup& group : report.groups) {
            if (group.name == "unknown_p90_mm")
                for (const Measure& m : group.values) places.push_back({m.name, m.value, 0});
            if (group.name != "unknown_p90_with_two_landmarks_mm") continue;
            for (UnknownPlace& place : places)
                for (const Measure& m : group.values)
                    if (m.name == place.label) place.with_landmarks_mm = m.value;
        }
    }
    std::stable_sort(
        places.begin(), places.end(),
        [](const UnknownPlace& a, const UnknownPlace& b) { return a.p90_mm > b.p90_mm; });
    return places;
}

std::vector<UnknownPlace> unknown_places_of_case(const CaseBundle& bundle) {
    std::vector<UnknownPlace> places = unknown_places(bundle.manifest.stages);
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) continue;
        for (const Target& target : exercise->targets)
            for (UnknownPlace& place : places)
                if (place.label == target.inside) place.target = true;
    }
    std::stable_partition(places.begin(), places.end(),
                          [](const UnknownPlace& place) { return place.target; });
    return places;
}

std::string landmark_advice(std::span<const UnknownPlace> places) {
    const UnknownPlace* most = nullptr;
    const auto gain = [](const UnknownPlace& p) { return p.p90_mm - p.with_landmarks_mm; };
    for (const UnknownPlace& place : places) {
        if (!(place.with_landmarks_mm > 0) || place.with_landmarks_mm > 0.9 * place.p90_mm)
            continue;
        if (most == nullptr || place.target > most->target ||
            (place.target == most->target && gain(place) > gain(*most)))
            most = &place;
    }
    if (most == nullptr) return "";
    return text("two landmarks far apart would bring %s from %.1f to %.1f mm", most->label.c_str(),
                most->p90_mm, most->with_landmarks_mm);
}

}  // namespace sonocase::pipeline::inline exporting
