// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/stage_keys.h"

#include <algorithm>
#include <cstdio>
#include <initializer_list>

#include "formats/base/digest.h"
#include "formats/container/chunk_file.h"
#include "pipeline/cook/pack_case.h"
#include "pipeline/import/label_map.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/segmentation/smooth_labels.h"

namespace sonocase::pipeline {
namespace {

// Of stages whose headers name none. A change of what a stage computes raises its number, and with
// it every key that the stage has a part in.
constexpr int kTextureVersion = 1;
constexpr int kStructureVersion = 2;

std::string number_text(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
}

std::string numbers_text(std::string text, std::initializer_list<double> values) {
    for (const double value : values) text += " " + number_text(value);
    return text;
}

// Everything of the analytic torso that its label map or its mannequin can depend on.
std::string analytic_labels(const AnalyticInput& in) {
    return numbers_text("analytic", {in.body.width_scale, in.body.depth_scale, in.body.belly_mm,
                                     in.voxel_mm, in.slice_mm});
}
std::string analytic_mannequin(const AnalyticInput& in) {
    return numbers_text(
        "analytic",
        {in.body.width_scale, in.body.depth_scale, in.body.belly_mm, in.mannequin.noise_mm,
         in.mannequin.strength, static_cast<double>(in.mannequin.points),
         in.mannequin.mesh ? 1.0 : 0.0, in.mannequin.front_only ? 1.0 : 0.0,
         static_cast<double>(in.mannequin.seed), static_cast<double>(in.body.warp),
         static_cast<double>(in.landmarks), in.landmark_noise_mm});
}

std::string hint_text(const RecipeInputs& in) {
    if (in.analytic && in.torso.known_map) return "known";
    if (!in.up) return "";
    return numbers_text("up", {in.up->x, in.up->y, in.up->z});
}

bool is_smoothed(const StageOptions& stage) {
    const std::string& method = stage.smooth_method;
    return method == "joint" || method == "level_set" ||
           (method == "auto" && stage.resample.method == "nearest");
}

std::string plan_key(const PlannedStage& stage,
                     const std::vector<PlannedStage>& before,
                     const std::vector<std::string>& besides) {
    Digest digest;
    digest.add(std::string_view("sonocase plan")).add(std::string_view(stage.stage));
    digest.add(std::int64_t{stage.version});
    for (const auto* texts : {&stage.own, &besides})
        for (const std::string& text : *texts) digest.add(std::string_view(text));
    for (const std::string& need : stage.needs)
        for (const PlannedStage& other : before)
            if (other.stage == need) digest.add(std::string_view(other.plan_key));
    return digest.hex();
}

}  // namespace

std::string tissues_text(const std::vector<Tissue>& tissues) {
    std::string text;
    for (const Tissue& t : tissues) {
        text += t.name + "|" + t.texture + "|" + std::to_string(static_cast<int>(t.kind)) + "|" +
                (t.casts_shadow ? "1" : "0");
        for (const double value : {t.grey_mean, t.grey_sd, t.echo_db, t.structure_db,
                                   t.attenuation_db_cm_mhz, t.impedance_mrayl, t.sound_speed_m_s})
            text += "|" + number_text(value);
        text += "\n";
    }
    return text;
}

std::string palette_text(const std::vector<Label>& labels) {
    std::string text;
    for (const Label& label : labels) text += label.name + "=" + label.tissue + "\n";
    return text;
}

Result<InputDigests> digest_inputs(const Recipe& recipe, const DigestOfInput& digest) {
    InputDigests inputs;
    const RecipeInputs& in = recipe.inputs;
    struct Item {
        const std::string& given;
        std::string& to;
    };
    for (const Item& item : {Item{in.labels, inputs.labels},
                             {in.label_table, inputs.label_table},
                             {in.surface, inputs.surface},
                             {in.examples, inputs.examples},
                             {in.landmarks, inputs.landmarks}}) {
        if (item.given.empty()) continue;
        auto hash = digest(recipe.resolve(item.given));
        if (!hash) return hash.error();
        item.to = *hash;
        inputs.files.push_back({item.given, std::move(*hash)});
    }
    return inputs;
}

std::vector<PlannedStage> plan_stages(const Recipe& recipe, const InputDigests& inputs) {
    const RecipeInputs& in = recipe.inputs;
    const auto options = [&](std::string_view section) {
        return canonical_options(section, recipe.options);
    };
    const std::string labels =
        in.analytic ? analytic_labels(in.torso)
                    : inputs.labels + " " + inputs.label_table + " " + number_text(in.labels_scale);
    const std::string surface = in.analytic ? analytic_mannequin(in.torso)
                                            : inputs.surface + " " + number_text(in.surface_scale);
    const std::string cooked = is_smoothed(recipe.options) ? "smooth" : "resample";

    std::vector<PlannedStage> stages{
        {"import", kImportVersion, {labels}, {}, ""},
        {"surface", kSurfaceVersion, {options("surface")}, {"import"}, ""},
        {"warp",
         kRegisterVersion,
         {surface, inputs.landmarks, hint_text(in), options("align"), options("warp"),
          options("case")},
         {"surface"},
         ""},
        {"resample", kResampleVersion, {options("resample")}, {"import", "warp"}, ""}};
    if (cooked == "smooth")
        stages.push_back({"smooth", kSmoothVersion, {options("smooth")}, {"resample"}, ""});
    stages.push_back({"texture",
                      kTextureVersion,
                      {inputs.examples, options("texture"), options("case")},
                      {cooked},
                      ""});
    stages.push_back(
        {"structure", kStructureVersion, {options("structure"), options("case")}, {cooked}, ""});
    PlannedStage pack{"pack",
                      kPackVersion,
                      {std::to_string(kContainerVersion), recipe.name, recipe.text, surface},
                      {"import", "surface", "warp", cooked, "texture", "structure"},
                      ""};
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        pack.own.push_back(exercise.name);
        pack.own.push_back(exercise.toml);
    }
    for (const InputHash& file : inputs.files) pack.own.push_back(file.path + " " + file.digest);
    stages.push_back(std::move(pack));

    // Which tissues a case uses is known once its labels are there; the plan takes all of them.
    std::vector<std::string> tissues{tissues_text(recipe.tissues)};
    for (const LabelChoice& choice : recipe.labels)
        tissues.push_back(choice.label + "=" + choice.tissue);
    std::vector<PlannedStage> done;
    for (PlannedStage& stage : stages) {
        const bool by_tissue = stage.stage == "texture" || stage.stage == "structure";
        stage.plan_key = plan_key(stage, done, by_tissue ? tissues : std::vector<std::string>{});
        done.push_back(stage);
    }
    return stages;
}

}  // namespace sonocase::pipeline
