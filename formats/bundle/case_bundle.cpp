// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/case_bundle.h"

#include "formats/bundle/attribution.h"
#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/bundle/codec/region_codec.h"
#include "formats/bundle/codec/volume_json.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;

// The answer key, for other programs: what the stage "pathology" reports of each lesion, as an
// object of its own. Readers take it from the stage's report.
Json pathology_of(const StageReport& report) {
    Json out = Json::array();
    for (const MeasureGroup& lesion : report.groups) {
        Json item = Json::object();
        item["name"] = lesion.name;
        const std::string prefix = lesion.name + ".";
        for (const Note& note : report.notes)
            if (note.name.starts_with(prefix)) item[note.name.substr(prefix.size())] = note.text;
        for (const Measure& measure : lesion.values) item[measure.name] = measure.value;
        out.push_back(std::move(item));
    }
    return out;
}

Json manifest_of(const CaseBundle& bundle) {
    Json out = Json::object();
    out["format"] = "sonocase case";
    out["case_name"] = bundle.manifest.case_name;
    out["producer"] = bundle.manifest.producer;
    out["frame"] = "mannequin";
    out["grid"] = detail::json_of(bundle.grid);
    out["labels"] = detail::json_of(bundle.labels);
    out["tissues"] = detail::json_of(bundle.tissues);
    out["textures"] = detail::json_of_textures(bundle.textures);
    out["speckle_edge"] = bundle.speckle.edge;
    Json exercises = Json::array();
    for (const EmbeddedExercise& exercise : bundle.exercises) {
        Json item = Json::object();
        item["name"] = exercise.name;
        item["toml"] = exercise.toml;
        exercises.push_back(std::move(item));
    }
    out["exercises"] = std::move(exercises);
    out["recipe"] = bundle.manifest.recipe;
    Json inputs = Json::array();
    for (const InputHash& input : bundle.manifest.inputs) {
        Json item = Json::object();
        item["path"] = input.path;
        item["digest"] = input.digest;
        inputs.push_back(std::move(item));
    }
    out["inputs"] = std::move(inputs);
    out["stages"] = detail::json_of(bundle.manifest.stages);
    // A case without lesions or an attribution keeps its bytes.
    for (const StageReport& report : bundle.manifest.stages) {
        if (!report.groups.empty() && report.stage == "pathology")
            out["pathology"] = pathology_of(report);
    }
    if (const std::string text = attribution_of(bundle); !text.empty()) out["attribution"] = text;
    return out;
}

}  // namespace

std::string attribution_of(const CaseBundle& bundle) {
    for (const StageReport& report : bundle.manifest.stages)
        for (const Note& note : report.notes)
            if (report.stage == "import" && note.name == "attribution") return note.text;
    return {};
}

std::vector<int> tissue_of_label(const CaseBundle& bundle) {
    std::vector<int> out;
    for (const Label& label : bundle.labels) {
        int index = 0;
        for (std::size_t t = 0; t < bundle.tissues.size(); ++t) {
            if (bundle.tissues[t].name == label.tissue) index = static_cast<int>(t);
        }
        out.push_back(index);
    }
    return out;
}

std::vector<std::uint8_t> write_bundle(const CaseBundle& bundle, JobRunner& jobs) {
    ChunkWriter writer("CASE");
    Json manifest = manifest_of(bundle);
    detail::add_volumes(writer, manifest, bundle.label_bricks, bundle.boundary, bundle.echo_offset,
                        jobs);
    if (bundle.region) writer.add("region", false, detail::region_bytes(*bundle.region, jobs));
    if (!bundle.textures.empty()) detail::add_textures(writer, bundle.textures);
    if (bundle.speckle.edge != 0) writer.add_array("speckle", false, bundle.speckle.voxels);
    if (!bundle.patient_skin.points.empty())
        detail::add_surface(writer, "skin.pat", bundle.patient_skin);
    if (!bundle.skin_unfitted.empty()) writer.add_array("skin.fit", false, bundle.skin_unfitted);
    if (!bundle.mannequin_skin.points.empty())
        detail::add_surface(writer, "skin.man", bundle.mannequin_skin);
    if (!bundle.flow.empty()) writer.add("flow", false, detail::flow_bytes(bundle.flow));
    if (!bundle.preview_png.empty()) writer.add_array("preview", false, bundle.preview_png);
    return writer.write(jobs);
}

}  // namespace sonocase
