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
    const auto labels = inputs.get<LabelFile>("ct_labels");
    if (!labels) return labels.error();
    auto cropped = crop_labels((*labels)->volume, inputs.options<CropOptions>("crop"));
    if (!cropped) return cropped.error();
    return StageValue::of(
        LabelFile{"ct", std::move(cropped->volume), {}, {}, {std::move(cropped->report)}});
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input("ct_labels", "Labels in the ct frame: .labels or any label map")};
    verb.output_type = "OUT.labels";
    verb.output_meaning = "Where to write";
    verb.save = [](StageInputs&, const StageValue& value, const std::string& path) {
        return save_labels(value.as<LabelFile>(), {}, path);
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
    stage.takes = {"ct_labels"};
    stage.provides = "ct_labels";  // instead of those that import provides
    stage.options = options();
    stage.run = run;
    stage.codec = label_codec();
    stage.reports = label_reports;
    stage.share = 0.01;
    stage.cost = {1, 240, 0, 4, 0};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline
