// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/case_bundle.h"

#include <new>
#include <optional>

#include "formats/base/jobs.h"
#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/bundle/codec/volume_json.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr std::string_view kKnownChunks[] = {
    "manifest", SONOCASE_VOLUME_CHUNKS, "textures", "speckle", "skin.pat", "skin.man", "preview"};
constexpr std::size_t kMaxPreviewBytes = std::size_t{64} << 20;

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
    return out;
}

void read_manifest_into(CaseBundle& bundle, JsonObject& manifest) {
    bundle.manifest.case_name = manifest.text_or("case_name", "");
    bundle.manifest.producer = manifest.text_or("producer", "");
    bundle.manifest.recipe = manifest.text_or("recipe", "");
    if (manifest.has("inputs")) {
        for (JsonObject& item : manifest.objects("inputs")) {
            bundle.manifest.inputs.push_back({item.text("path"), item.text("digest")});
        }
    }
    bundle.manifest.stages = detail::reports_from(manifest, "stages");
    bundle.grid = detail::grid_from(manifest.object("grid"));
    bundle.labels = detail::labels_from(manifest, "labels");
    bundle.tissues = detail::tissues_from(manifest, "tissues");
    if (manifest.has("exercises")) {
        for (JsonObject& item : manifest.objects("exercises")) {
            bundle.exercises.push_back({item.text("name"), item.text("toml")});
        }
    }
    const Grid& grid = bundle.grid;
    if (!manifest.ok()) return;
    if (grid.spacing_mm.x != grid.spacing_mm.y || grid.spacing_mm.x != grid.spacing_mm.z) {
        manifest.complain("grid", "has voxels that are no cubes", "cook the case again");
    }
    if (grid.direction != Matrix3{}) {
        manifest.complain("grid", "is turned against its frame", "cook the case again");
    }
    for (const Label& label : bundle.labels) {
        bool found = false;
        for (const Tissue& tissue : bundle.tissues) found |= tissue.name == label.tissue;
        if (!found) {
            manifest.complain("labels",
                              "name the tissue '" + label.tissue + "', which is not in the table");
        }
    }
}

// What is small, by one thread.
Status read_others_into(CaseBundle& bundle,
                        const ChunkReader& reader,
                        const Json& json,
                        const std::string& where) {
    constexpr int threads = 1;
    JsonFault fault{where + ": manifest", {}};
    JsonObject manifest(json, "", fault);
    auto textures = detail::read_textures(reader, manifest, threads);
    if (!textures) return textures.error();
    bundle.textures = std::move(*textures);
    auto speckle = detail::read_speckle(reader, manifest, threads);
    if (!speckle) return speckle.error();
    bundle.speckle = std::move(*speckle);
    if (fault.error) return *fault.error;
    auto patient = detail::read_surface(reader, "skin.pat", threads);
    if (!patient) return patient.error();
    bundle.patient_skin = std::move(*patient);
    auto mannequin = detail::read_surface(reader, "skin.man", threads);
    if (!mannequin) return mannequin.error();
    bundle.mannequin_skin = std::move(*mannequin);
    if (!reader.has("preview")) return Done{};
    auto preview = reader.read("preview", kMaxPreviewBytes, threads);
    if (!preview) return preview.error();
    bundle.preview_png = std::move(*preview);
    return Done{};
}

Result<CaseBundle> read_checked(std::span<const std::uint8_t> bytes,
                                const std::string& where,
                                int threads) {
    const auto reader = ChunkReader::open(bytes, "CASE", kKnownChunks, where);
    if (!reader) return reader.error();
    const auto json = detail::read_manifest(*reader);
    if (!json) return json.error();
    CaseBundle bundle;
    JsonFault fault{where + ": manifest", {}};
    JsonObject manifest(*json, "", fault);
    read_manifest_into(bundle, manifest);
    if (fault.error) return *fault.error;
    // Textures, surfaces and preview meanwhile.
    std::optional<Result<detail::VoxelVolumes>> volumes;
    Status others = Done{};
    detail::run_jobs(2, threads, [&](std::size_t job) {
        if (job == 1) {
            others = read_others_into(bundle, *reader, *json, where);
        } else {
            volumes = detail::read_volumes(*reader, manifest, bundle.grid.size,
                                           bundle.labels.size(), threads);
        }
    });
    if (!*volumes) return volumes->error();
    bundle.label_bricks = std::move((*volumes)->labels);
    bundle.boundary = std::move((*volumes)->boundary);
    bundle.echo_offset = std::move((*volumes)->echo_offset);
    if ((*volumes)->packed)
        bundle.blocks = std::make_shared<VoxelBlocks>(std::move((*volumes)->packed));
    if (fault.error) return *fault.error;
    if (!others) return others.error();
    return bundle;
}

Error no_memory(const std::string& where) {
    return {"needs more memory than there is", where, "use a case with larger voxels"};
}

}  // namespace

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

Result<CaseBundle> read_bundle(std::span<const std::uint8_t> bytes,
                               const std::string& where,
                               int threads) {
    try {
        auto bundle = read_checked(bytes, where, threads);
        if (!bundle || !bundle->blocks) return bundle;
        bundle->blocks->load_all(threads);
        if (Status whole = bundle->blocks->status(); !whole) return whole.error();
        bundle->blocks.reset();
        return bundle;
    } catch (const std::bad_alloc&) {
        return no_memory(where);
    }
}

std::vector<std::uint8_t> write_bundle(const CaseBundle& bundle) {
    ChunkWriter writer("CASE");
    Json manifest = manifest_of(bundle);
    detail::add_volumes(writer, manifest, bundle.label_bricks, bundle.boundary, bundle.echo_offset);
    if (!bundle.textures.empty()) detail::add_textures(writer, bundle.textures);
    if (bundle.speckle.edge != 0) writer.add_array("speckle", false, bundle.speckle.voxels);
    if (!bundle.patient_skin.points.empty())
        detail::add_surface(writer, "skin.pat", bundle.patient_skin);
    if (!bundle.mannequin_skin.points.empty())
        detail::add_surface(writer, "skin.man", bundle.mannequin_skin);
    if (!bundle.preview_png.empty()) writer.add_array("preview", false, bundle.preview_png);
    return writer.write();
}

Result<CaseBundle> stream_bundle(RawVector<std::uint8_t> bytes,
                                 const std::string& where,
                                 int threads) {
    try {
        auto bundle = read_checked(bytes, where, threads);
        // What the blocks refer to stays where it is while the vector moves.
        if (bundle && bundle->blocks) {
            bundle->blocks->keep(std::move(bytes));
            bundle->blocks->use_small_pages();
        }
        return bundle;
    } catch (const std::bad_alloc&) {
        return no_memory(where);
    }
}

}  // namespace sonocase
