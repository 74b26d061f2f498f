// SPDX-License-Identifier: Apache-2.0

// import: a segmented CT, or the analytic torso, becomes labels in the `ct` frame.
#include "formats/files/stage_file.h"
#include "pipeline/import/label_map.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/key_text.h"
#include "pipeline/stages/label_codec.h"

namespace sonocase::pipeline {
namespace {

LabelFile sample_analytic(const AnalyticInput& in) {
    LabelFile file;
    file.frame = "ct";
    const double across = in.voxel_mm;
    file.volume =
        sample_analytic_torso(analytic_torso_grid({across, across, in.slice_mm}), in.body);
    StageReport report;
    report.stage = "import";
    report.version = kImportVersion;
    const Vector3 extent = body_box(file.volume).extent();
    report.measures = {{"labels", static_cast<double>(file.volume.labels.size() - 1)},
                       {"voxel_volume_mm3", file.volume.grid.voxel_volume_mm3()},
                       {"body_width_mm", extent.x},
                       {"body_depth_mm", extent.y},
                       {"body_height_mm", extent.z}};
    file.reports = {report};
    return file;
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const RecipeInputs& in = inputs.recipe().inputs;
    if (in.analytic) return StageValue::of(sample_analytic(in.torso));
    ImportOptions options;
    options.table = inputs.recipe().resolve(in.label_table);
    options.scale = in.labels_scale;
    auto imported = import_label_map(inputs.recipe().resolve(in.labels), options, progress);
    if (!imported) return imported.error();
    return StageValue::of(
        LabelFile{"ct", std::move(imported->labels), {}, {}, {std::move(imported->report)}});
}

// Everything that the labels depend on; of the analytic torso, what its label map shows of it.
std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests& digests) {
    const RecipeInputs& in = recipe.inputs;
    const AnalyticBody& body = in.torso.body;
    if (in.analytic)
        return {key_text("analytic", {body.width_scale, body.depth_scale, body.belly_mm,
                                      in.torso.voxel_mm, in.torso.slice_mm})};
    return {key_text(digests.labels + " " + digests.label_table, {in.labels_scale})};
}

StageVerb verb() {
    StageVerb verb;
    verb.inputs = {
        {"LABELS", "",
         "NIfTI, NRRD, .seg.nrrd, MetaImage, folder of masks, or folder of DICOM slices", true,
         &RecipeInputs::labels},
        {"--table", "FILE.csv", "Names of the values: rows of value,name[,tissue_class]", false,
         &RecipeInputs::label_table},
        {"--scale", "", "Millimetres per unit of the file", false, &RecipeInputs::labels_scale}};
    verb.output_type = "CT.labels";
    verb.output_meaning = "Where to write";
    verb.save = [](StageInputs&, const StageValue& value, const std::string& path) {
        LabelFile file = value.as<LabelFile>();
        file.reports = without_seconds(file.reports);
        return save_label_file(file, path);
    };
    return verb;
}

}  // namespace

StageDescriptor import_stage() {
    StageDescriptor stage;
    stage.name = "import";
    stage.version = kImportVersion;
    stage.summary = "read a label map of any kind";
    stage.about = "Read a label map of any kind into labels in the ct frame (RAS+, mm)";
    stage.provides = "ct_labels";
    stage.key_texts = key_texts;
    stage.run = run;
    stage.codec = label_codec();
    stage.reports = label_reports;
    // A mistake in the recipe's [labels] is reported now, long before its tissues are used.
    stage.check = [](const Recipe& recipe, const StageValue& value) -> Status {
        std::vector<Label> labels = value.as<LabelFile>().volume.labels;
        return assign_tissues(recipe, labels);
    };
    stage.share = 0.03;
    stage.cost = {1, 240, 1.2, 4, 0};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline
