// SPDX-License-Identifier: Apache-2.0

// pack: puts everything that the stages made into one bundle. Its result is not kept in the cache,
// since the bundle itself is kept.
#include "formats/base/constants.h"
#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/stage_files.h"
#include "pipeline/export/error_budget.h"
#include "pipeline/flow/cook_flow.h"
#include "pipeline/pathology/answer_key.h"
#include "pipeline/registration/fit/fit_measure.h"
#include "pipeline/registration/skin/skin_surface.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/mannequin_step.h"
#include "pipeline/stages/pack_case.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/structure_stage.h"

#include <cmath>

namespace sonocase::pipeline::inline stages {
namespace {

// Adds what the case's own reports say of its error.
void add_error_budget(const std::vector<StageReport>& reported, StageReport& report) {
    const ErrorBudget budget = error_budget(reported);
    for (const BudgetEntry& entry : budget.entries)
        if (std::isfinite(entry.mm))
            report.measures.push_back({entry.stage + "_error_mm", entry.mm});
    report.measures.push_back({"known_error_mm", budget.known_mm});
}

// Returns the answer key as targets: the radius is that of the ball of a lesion's volume.
std::vector<KeyTarget> targets_of(const StageReport& report, const Recipe& recipe) {
    std::vector<KeyTarget> targets;
    for (const PathologyEntry& e : key_of(report)) {
        KeyTarget target{e.name, e.centre, std::cbrt(3000 * e.volume_ml / (4 * kPi)), false};
        for (const PathologyRequest& request : recipe.settings.of<PathologyOptions>().requests)
            if (request.name == e.name) target.by_default = request.target;
        targets.push_back(std::move(target));
    }
    return targets;
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    SONOCASE_TRY(const auto mannequin, inputs.get(kMannequin));
    SONOCASE_TRY(const auto skin, inputs.get(kSkin));
    SONOCASE_TRY(const auto registration, inputs.get(kRegistration));
    SONOCASE_TRY(const auto labels, inputs.get(kLabels));
    SONOCASE_TRY(const auto used, inputs.get(kTissues));
    SONOCASE_TRY(const auto textures, inputs.get(kTextures));
    SONOCASE_TRY(const auto structure, inputs.get(kStructure));
    SONOCASE_TRY(const auto flow, inputs.get(kFlow));
    report_progress(progress, 0, "packing");
    const Recipe& recipe = inputs.recipe();
    SONOCASE_TRY(auto unfitted, unfitted_skin(skin->skin, mannequin->surface, *registration));
    PackInput input{.case_name = recipe.name,
                    .recipe_text = recipe.text,
                    .exercises = recipe.exercises,
                    .ct_skin = &skin->skin,
                    .registration = registration,
                    .mannequin = mannequin->surface,
                    .cooked = labels->volume,
                    .palette = used->palette,
                    .boundary = labels->boundary,
                    .echo_offset = structure->offset,
                    .textures = *textures,
                    .tissues = used->tissues,
                    .skin_unfitted = std::move(unfitted),
                    .flow = flow->field,
                    .region = labels->region ? &*labels->region : nullptr};
    for (const StageReport& report : inputs.reported())
        if (report.stage == stage_names::kPathology) input.key = targets_of(report, recipe);
    SONOCASE_TRY(auto packed, pack_case(input));
    add_error_budget(inputs.reported(), packed.report);
    return StageValue::of(kCase, std::move(packed));
}

std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests& digests) {
    std::vector<std::string> texts{std::to_string(kContainerVersion), recipe.name, recipe.text};
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        texts.push_back(exercise.name);
        texts.push_back(exercise.toml);
    }
    for (const InputHash& file : digests.files) texts.push_back(file.path + " " + file.digest);
    return texts;
}

}  // namespace

StageDescriptor pack_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kPack;
    stage.version = kPackVersion;
    stage.takes = {kMannequin, kSkin,     kRegistration, kLabels,
                   kTissues,   kTextures, kStructure,    kFlow};
    stage.provides = kCase;
    stage.key_texts = key_texts;
    stage.run = run;
    stage.reports = reports_of(kCase);
    stage.share = 0.05;
    stage.cost = {.threads = 1, .per_cooked_voxel = 3.8, .per_region_voxel = 1.5};
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
