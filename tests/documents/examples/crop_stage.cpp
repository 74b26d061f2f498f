// SPDX-License-Identifier: Apache-2.0

// crop: cuts the labels of the patient down to the body, before anything else looks at them.
#include "documents/examples/crop_labels.h"
#include "pipeline/stages/label_codec.h"

namespace sonocase::pipeline {
namespace {

OptionGroup options() {
    return OptionsOf<CropOptions>("crop")
        .number(
            "margin_mm", [](auto& o) { return &o.margin_mm; }, 0, 50, "mm",
            "air kept round the body")
        .sweep({"case", {"0", "5", "20"}, "none: only memory is at stake", ""});
}

Result<StageValue> run(StageInputs& inputs, const Progress&) {
    SONOCASE_TRY(const LabelFile* const labels, inputs.get(kCtLabels));
    SONOCASE_TRY(CropResult cropped, crop_labels(labels->volume, inputs.options<CropOptions>()));
    return StageValue::of(
        kCtLabels, LabelFile{"ct", std::move(cropped.volume), {}, {}, {std::move(cropped.report)}});
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input(kCtLabels, "Labels in the ct frame: .labels or any label map")};
    verb.output_type = "OUT.labels";
    verb.output_meaning = "Where to write";
    verb.save = [](StageInputs&, const StageValue& value, const std::string& path) {
        return save_labels(value.as(kCtLabels), {}, path);
    };
    return verb;
}

}  // namespace

StageDescriptor crop_stage() {
    StageDescriptor stage;
    stage.name = "crop";
    stage.version = kCropVersion;
    stage.summary = "cut a label map down to its body";
    stage.about = "Cut a label map down to the box of its body and a margin";
    stage.takes = {kCtLabels};
    stage.provides = kCtLabels;  // instead of those that import provides
    stage.options = options();
    stage.run = run;
    stage.codec = label_codec(kCtLabels);
    stage.reports = reports_of(kCtLabels);
    stage.share = 0.01;
    stage.cost = {.threads = 1, .per_label_voxel = 4};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline
