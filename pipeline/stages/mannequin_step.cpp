// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/mannequin_step.h"

#include <algorithm>

#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/registration/skin/skin_surface.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {
namespace {

Result<StageValue> run(StageInputs& inputs, const Progress&) {
    SONOCASE_TRY(auto mannequin, read_mannequin(inputs.recipe()));
    return StageValue::of(kMannequin, std::move(mannequin));
}

// The texts hold everything that the mannequin can depend on, for the analytic torso as well.
std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests& digests) {
    const RecipeInputs& in = recipe.inputs;
    if (!in.analytic)
        return {key_text(digests.surface + " axes " + in.surface_axes, {in.surface_scale})};
    const AnalyticInput& torso = in.torso;
    const AnalyticMannequinOptions& made = torso.mannequin;
    return {key_text(
        "analytic",
        {torso.body.width_scale, torso.body.depth_scale, torso.body.belly_mm, made.noise_mm,
         made.strength, static_cast<double>(made.points), made.mesh ? 1.0 : 0.0,
         made.front_only ? 1.0 : 0.0, static_cast<double>(made.seed),
         static_cast<double>(torso.body.warp), static_cast<double>(torso.body.neck_seed),
         static_cast<double>(torso.landmarks), torso.landmark_noise_mm})};
}

}  // namespace

Result<Mannequin> read_mannequin(const Recipe& recipe) {
    const RecipeInputs& in = recipe.inputs;
    Mannequin mannequin;
    if (in.analytic) {
        mannequin.surface = analytic_torso_mannequin(in.torso.mannequin, in.torso.body);
        return mannequin;
    }
    SurfaceFileOptions options;
    options.scale = in.surface_scale;
    options.axes = axes_named(in.surface_axes);
    SONOCASE_TRY(auto surface,
                 import_surface(recipe.resolve(in.surface), options, &mannequin.report));
    mannequin.surface = std::move(surface);
    return mannequin;
}

Vector3 extent_of(const Surface& surface) {
    Box3 box;
    for (const Point3 p : surface.points) box.include(p);
    return box.extent();
}

StageDescriptor mannequin_step() {
    StageDescriptor step;
    step.name = "mannequin";
    step.provides = kMannequin;
    step.active = [](const Recipe& recipe) { return !recipe.inputs.own_skin; };
    step.key_texts = key_texts;
    step.run = run;
    step.warnings = [](const StageValue& value) {
        std::vector<std::string> warnings;
        for (const std::string& warning : value.as(kMannequin).report.warnings)
            warnings.push_back("surface: " + warning);
        // What was turned or scaled on the file's word alone; a surface that is kept needs none.
        const std::vector<Note>& notes = value.as(kMannequin).report.notes;
        const auto said = [&](const char* name) {
            return std::find_if(notes.begin(), notes.end(),
                                [&](const Note& note) { return note.name == name; });
        };
        if (const auto axes = said("axes_said"); axes != notes.end() && axes->text == "lps")
            warnings.push_back("surface: " + said("axes")->text);
        if (const auto unit = said("unit"); unit != notes.end())
            warnings.push_back("surface: " + unit->text);
        return warnings;
    };
    return step;
}

// The patient's own skin stands for the mannequin: the frame `mannequin` is then `ct`.
StageDescriptor own_skin_step() {
    StageDescriptor step;
    step.name = "own_skin";
    step.takes = {kSkin};
    step.provides = kMannequin;
    step.active = [](const Recipe& recipe) { return recipe.inputs.own_skin; };
    step.run = [](StageInputs& inputs, const Progress&) -> Result<StageValue> {
        SONOCASE_TRY(const auto skin, inputs.get(kSkin));
        return StageValue::of(kMannequin, Mannequin{skin->skin, {}});
    };
    return step;
}

}  // namespace sonocase::pipeline::inline stages
