// SPDX-License-Identifier: Apache-2.0

// pathology: lesions and the like, painted into the cooked labels as [[pathology]] asks. A case has
// this stage where its recipe has such a section.
#include "pipeline/stages/pathology_stage.h"
#include "formats/registration/registration.h"
#include "pipeline/pathology/carry_into_region.h"
#include "pipeline/pathology/pathology.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/key_text.h"
#include "pipeline/stages/label_codec.h"

namespace sonocase::pipeline {
namespace {

const std::vector<PathologyRequest>& requests_of(const Recipe& recipe) {
    return recipe.settings.of<PathologyOptions>("pathology").requests;
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const Recipe& recipe = inputs.recipe();
    const auto labels = inputs.get<LabelFile>("labels");
    if (!labels) return labels.error();
    const auto registration = inputs.get<Registration>("registration");
    if (!registration) return registration.error();
    std::vector<Label> palette = (*labels)->volume.labels;
    if (auto status = assign_tissues(recipe, palette); !status) return status.error();
    const Box3& box = (*registration)->ct_box;
    auto result = place_pathology(
        {(*labels)->volume, (*labels)->boundary, palette, recipe.tissues, requests_of(recipe),
         recipe.path, [&](Point3 ct) { return mannequin_from_ct(**registration, ct); },
         box.empty() ? Point3{} : box.centre()},
        progress);
    if (!result) return result.error();
    std::optional<FineRegion> region = (*labels)->region;
    if (region) {
        const double reach_vx = recipe.settings.of<ResampleOptions>("resample").record_band_vx;
        carry_into_region({(*labels)->volume, (*labels)->boundary},
                          {result->volume, result->boundary}, reach_vx, &*region);
    }
    return label_value((*labels)->frame, std::move(*result), std::move(region));
}

std::string request_text(const PathologyRequest& r) {
    std::string text = r.name + "|" + r.kind + "|" + r.tissue;
    for (const auto* list : {&r.host, &r.into, &r.beside})
        for (const std::string& name : *list) text += "|" + name;
    for (const auto& [part, size] : r.parts) text += key_text("|" + part, {size});
    std::vector<double> values{r.volume_ml,
                               r.diameter_mm,
                               r.elongation,
                               r.roughness,
                               r.depth_low_mm,
                               r.depth_high_mm,
                               r.capsule_mm,
                               r.vessel_mm,
                               r.apart_mm,
                               r.near_mm,
                               r.length_mm,
                               r.share,
                               r.reach_mm,
                               r.mass_effect,
                               r.reach,
                               static_cast<double>(r.seed),
                               r.in_mannequin ? 1.0 : 0.0};
    const auto add = [&](Point3 p) { values.insert(values.end(), {p.x, p.y, p.z}); };
    values.push_back(r.centre ? 1 : 0);
    if (r.centre) add(*r.centre);
    values.push_back(r.near ? 1 : 0);
    if (r.near) add(*r.near);
    for (const Point3 p : r.path) add(p);
    for (const double value : values) text = key_text(std::move(text), {value});
    return text;
}

// Which labels are vessels, bone or skin goes by their tissues.
std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests&) {
    std::vector<std::string> texts;
    for (const PathologyRequest& request : requests_of(recipe))
        texts.push_back(request_text(request));
    texts.push_back(tissues_text(recipe.tissues));
    for (const LabelChoice& choice : recipe.labels)
        texts.push_back(choice.label + "=" + choice.tissue);
    return texts;
}

}  // namespace

StageDescriptor pathology_stage() {
    StageDescriptor stage;
    stage.name = "pathology";
    stage.version = kPathologyVersion;
    stage.summary = "put lesions into cooked labels";
    stage.about = "Put the lesions of a recipe into cooked labels";
    stage.takes = {"labels", "registration"};
    stage.provides = "labels";
    stage.options = OptionsOf<PathologyOptions>("pathology");
    stage.key_texts = key_texts;
    stage.active = [](const Recipe& recipe) { return !requests_of(recipe).empty(); };
    stage.run = run;
    stage.codec = label_codec();
    stage.reports = label_reports;
    stage.share = 0.05;
    stage.cost = {2, 240, 0, 0, 8};
    return stage;
}

}  // namespace sonocase::pipeline
