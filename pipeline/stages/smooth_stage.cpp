// SPDX-License-Identifier: Apache-2.0

// smooth: takes the steps out of cooked labels. resample does so itself with its standard method;
// a case has this stage after resample.method nearest, or where the recipe asks for it.
#include "pipeline/export/segmentation_pictures.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/segmentation/smooth_labels.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/roles.h"

namespace sonocase::pipeline::inline stages {
namespace {

struct SmoothStageOptions {
    std::string method = "auto";  // auto | none | joint | level_set
    SmoothOptions smooth;         // its method is set from the one above
};

void add_joint(OptionsOf<SmoothStageOptions>& options) {
    options
        .choice(
            "method", [](auto& o) { return &o.method; }, {"auto", "none", "joint", "level_set"}, "",
            "auto: joint, or none in a case that resample has smoothed")
        .help_group("Method joint")
        .number(
            "sigma_vx", [](auto& o) { return &o.smooth.sigma_vx; }, 0, 4, "voxels",
            "joint: smoothing of the surfaces, standard deviation")
        .number(
            "detail_vx", [](auto& o) { return &o.smooth.detail_vx; }, 0, 4, "voxels",
            "joint: smoothing of structures that sigma_vx would wipe out")
        .number(
            "iterations", [](auto& o) { return &o.smooth.iterations; }, 1, 20, "",
            "joint: passes, one after the other")
        .flag("passes")
        .number(
            "volume_iterations", [](auto& o) { return &o.smooth.volume_iterations; }, 0, 50, "",
            "joint: Newton steps that keep each label's volume; 0: not kept")
        .number(
            "record_band_vx", [](auto& o) { return &o.smooth.record_band_vx; }, 0, 2.6, "voxels",
            "joint: reach of the boundary records; 0: none")
        .number(
            "snap_vx", [](auto& o) { return &o.smooth.snap_vx; }, 0, 0.5, "voxels",
            "joint: greatest distance that surfaces move onto quadrics; 0: none");
}

void add_level_set(OptionsOf<SmoothStageOptions>& options) {
    options.help_group("Method level_set")
        .number(
            "k0", [](auto& o) { return &o.smooth.level_set.k0; }, 0.0001, 100, "1/mm^2",
            "level_set: K0 of eq. (10)")
        .number(
            "level_set_iterations", [](auto& o) { return &o.smooth.level_set.iterations; }, 1, 1000,
            "", "level_set: steps of eq. (10)")
        .flag("iterations")
        .number(
            "time_step", [](auto& o) { return &o.smooth.level_set.time_step; }, 0, 1000, "mm^2",
            "level_set: time step of eq. (10); 0: 0.8 of the limit of stability")
        .toggle(
            "closest_point", [](auto& o) { return &o.smooth.level_set.closest_point; },
            "level_set: curvature at the nearest surface point");
}

OptionGroup options() {
    OptionsOf<SmoothStageOptions> options("smooth");
    add_joint(options);
    add_level_set(options);
    return options;
}

bool active(const Recipe& recipe) {
    const std::string& method = recipe.settings.of<SmoothStageOptions>().method;
    if (method != "auto") return method != "none";
    return recipe.settings.of<ResampleOptions>().method == "nearest";
}

Error region_is_in_the_way() {
    return {"the stage smooth would move surfaces away from those of the fine region",
            "smooth.method", "auto or none, or a recipe without [[region]]"};
}

Status can_do(const Recipe& recipe) {
    if (recipe.settings.of<ResampleOptions>().region) return region_is_in_the_way();
    return Done{};
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    SONOCASE_TRY(const auto labels, inputs.get(kLabels));
    const auto& options = inputs.options<SmoothStageOptions>();
    if (options.method == "none")
        return Error{"method none smooths nothing", "", "choose auto, joint or level_set"};
    if (labels->region) return region_is_in_the_way();
    SmoothOptions smooth = options.smooth;
    smooth.method = options.method == "level_set" ? "level_set" : "joint";
    SONOCASE_TRY(auto result, smooth_labels(labels->volume, smooth, progress));
    return label_value(labels->frame, std::move(result));
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input(kLabels, "Labels: .labels or any label map")};
    verb.output_type = "OUT";
    verb.output_meaning = kLabelOutput;
    verb.save = [](StageInputs& inputs, const StageValue& value,
                   const std::string& path) -> Status {
        SONOCASE_TRY(const auto before, inputs.get(kLabels));
        return save_labels(value.as(kLabels), before->reports, path);
    };
    verb.pictures_meaning = "Folder for pictures of before and after in three planes";
    verb.draw = [](StageInputs& inputs, const StageValue& value,
                   const std::string& folder) -> Status {
        SONOCASE_TRY(const auto before, inputs.get(kLabels));
        const LabelFile& file = value.as(kLabels);
        return write_segmentation_pictures({before->volume, nullptr, file.volume, file.boundary},
                                           folder);
    };
    return verb;
}

}  // namespace

StageDescriptor smooth_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kSmooth;
    stage.version = kSmoothVersion;
    stage.summary = "take the steps out of labels";
    stage.about = "Smooth all labels of a volume, each at its own volume";
    stage.takes = {kLabels};
    stage.provides = kLabels;
    stage.options = options();
    stage.active = active;
    stage.can_do = can_do;
    stage.run = run;
    stage.codec = label_codec(kLabels);
    stage.reports = reports_of(kLabels);
    stage.share = 0.1;
    stage.cost = {.threads = 2, .base_mb = 258, .per_cooked_voxel = 12};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
