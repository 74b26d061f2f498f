// SPDX-License-Identifier: Apache-2.0

// pack: everything that the stages made becomes one bundle. Its result is a PackResult; it is not
// kept in the cache, since the bundle itself is.
#include "formats/bundle/stage_files.h"
#include "formats/container/chunk_file.h"
#include "pipeline/flow/cook_flow.h"
#include "pipeline/pack/error_budget.h"
#include "pipeline/pack/pack_case.h"
#include "pipeline/pathology/answer_key.h"
#include "pipeline/registration/skin/skin_surface.h"
#include "pipeline/registration/unfitted_skin.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/mannequin_surface.h"
#include "pipeline/stages/structure_stage.h"

#include <cmath>

namespace sonocase::pipeline {
namespace {

// What the case's own reports say of its error, beside the figures of the bundle.
void add_error_budget(const std::vector<StageReport>& reported, StageReport& report) {
    const ErrorBudget budget = error_budget(reported);
    for (const BudgetEntry& entry : budget.entries)
        if (std::isfinite(entry.mm))
            report.measures.push_back({entry.stage + "_error_mm", entry.mm});
    report.measures.push_back({"known_error_mm", budget.known_mm});
}

// The answer key as targets: the radius is that of the ball of a lesion's volume.
std::vector<KeyTarget> targets_of(const StageReport& report, const Recipe& recipe) {
    std::vector<KeyTarget> targets;
    for (const PathologyEntry& e : key_of(report)) {
        KeyTarget target{e.name, e.centre, std::cbrt(3000 * e.volume_ml / (4 * 3.14159265358979)),
                         false};
        for (const PathologyRequest& request :
             recipe.settings.of<PathologyOptions>("pathology").requests)
            if (request.name == e.name) target.by_default = request.target;
        targets.push_back(std::move(target));
    }
    return targets;
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const auto mannequin = inputs.get<Mannequin>("mannequin");
    const auto skin = inputs.get<SkinSurfaceResult>("skin");
    const auto registration = inputs.get<Registration>("registration");
    const auto labels = inputs.get<LabelFile>("labels");
    const auto used = inputs.get<CaseTissues>("tissues");
    const auto textures = inputs.get<TextureFile>("textures");
    const auto structure = inputs.get<EchoOffsets>("structure");
    const auto flow = inputs.get<FlowResult>("flow");
    if (!mannequin) return mannequin.error();
    if (!skin) return skin.error();
    if (!registration) return registration.error();
    if (!labels) return labels.error();
    if (!used) return used.error();
    if (!textures) return textures.error();
    if (!structure) return structure.error();
    if (!flow) return flow.error();
    report_progress(progress, 0, "packing");
    const Recipe& recipe = inputs.recipe();
    auto unfitted = unfitted_skin((*skin)->skin, (*mannequin)->surface, **registration);
    if (!unfitted) return unfitted.error();
    PackInput input{recipe.name,         recipe.text,           recipe.exercises,  &(*skin)->skin,
                    *registration,       (*mannequin)->surface, (*labels)->volume, (*used)->palette,
                    (*labels)->boundary, (*structure)->offset,  **textures,        (*used)->tissues,
                    std::move(*unfitted)};
    input.flow = (*flow)->field;
    if ((*labels)->region) input.region = &*(*labels)->region;
    for (const StageReport& report : inputs.reported())
        if (report.stage == "pathology") input.key = targets_of(report, recipe);
    auto packed = pack_case(input);
    if (!packed) return packed.error();
    add_error_budget(inputs.reported(), packed->report);
    return StageValue::of(std::move(*packed));
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
    stage.name = "pack";
    stage.version = kPackVersion;
    stage.takes = {"mannequin", "skin",     "registration", "labels",
                   "tissues",   "textures", "structure",    "flow"};
    stage.provides = "case";
    stage.key_texts = key_texts;
    stage.run = run;
    stage.reports = [](const StageValue& value) {
        return std::vector<StageReport>{value.as<PackResult>().report};
    };
    stage.share = 0.05;
    stage.cost = {1, 240, 0, 0, 4.5};
    stage.cost.per_region_voxel = 1.5;
    return stage;
}

}  // namespace sonocase::pipeline
