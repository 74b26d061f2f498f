// SPDX-License-Identifier: Apache-2.0

// The readers of case_bundle.h and streamed_bundle.h.
#include <optional>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/bundle/codec/volume_json.h"
#include "formats/bundle/streamed_bundle.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr std::string_view kKnownChunks[] = {
    "manifest", SONOCASE_VOLUME_CHUNKS, "textures", "speckle", "skin.pat", "skin.fit", "skin.man",
    "preview"};
constexpr std::size_t kMaxPreviewBytes = std::size_t{64} << 20;

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
        manifest.complain("grid", "has voxels that are not cubes", "cook the case again");
    }
    if (grid.direction != Matrix3{}) {
        manifest.complain("grid", "is rotated relative to its frame", "cook the case again");
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

// Textures, surfaces and preview: small enough for one thread.
Status read_small_parts(CaseBundle& bundle,
                        const ChunkReader& reader,
                        const Json& json,
                        const std::string& where) {
    JsonFault fault{where + ": manifest", {}};
    JsonObject manifest(json, "", fault);
    auto textures = detail::read_textures(reader, manifest);
    if (!textures) return textures.error();
    bundle.textures = std::move(*textures);
    auto speckle = detail::read_speckle(reader, manifest);
    if (!speckle) return speckle.error();
    bundle.speckle = std::move(*speckle);
    if (fault.error) return *fault.error;
    auto patient = detail::read_surface(reader, "skin.pat");
    if (!patient) return patient.error();
    bundle.patient_skin = std::move(*patient);
    if (reader.has("skin.fit")) {
        auto unfitted =
            reader.read_array<std::uint8_t>("skin.fit", bundle.patient_skin.points.size());
        if (!unfitted) return unfitted.error();
        bundle.skin_unfitted = std::move(*unfitted);
    }
    auto mannequin = detail::read_surface(reader, "skin.man");
    if (!mannequin) return mannequin.error();
    bundle.mannequin_skin = std::move(*mannequin);
    if (!reader.has("preview")) return Done{};
    auto preview = reader.read("preview", kMaxPreviewBytes);
    if (!preview) return preview.error();
    bundle.preview_png = std::move(*preview);
    return Done{};
}

// A bundle whose blocks are still packed; blocks is null where the file's layout has none.
struct PackedBundle {
    CaseBundle bundle;
    std::unique_ptr<VoxelBlocks> blocks;
};

Result<PackedBundle> read_packed(std::span<const std::uint8_t> bytes,
                                 const std::string& where,
                                 JobRunner& jobs) {
    const auto reader = ChunkReader::open(bytes, "CASE", kKnownChunks, where);
    if (!reader) return reader.error();
    const auto json = detail::read_manifest(*reader);
    if (!json) return json.error();
    PackedBundle out;
    CaseBundle& bundle = out.bundle;
    JsonFault fault{where + ": manifest", {}};
    JsonObject manifest(*json, "", fault);
    read_manifest_into(bundle, manifest);
    if (fault.error) return *fault.error;
    std::optional<Result<detail::VoxelVolumes>> volumes;
    Status small_parts = Done{};
    jobs.run(2, [&](std::size_t job) {
        if (job == 1) {
            small_parts = read_small_parts(bundle, *reader, *json, where);
        } else {
            volumes = detail::read_volumes(*reader, manifest, bundle.grid.size,
                                           bundle.labels.size(), jobs);
        }
    });
    if (!*volumes) return volumes->error();
    bundle.label_bricks = std::move((*volumes)->labels);
    bundle.boundary = std::move((*volumes)->boundary);
    bundle.echo_offset = std::move((*volumes)->echo_offset);
    if ((*volumes)->packed)
        out.blocks = std::make_unique<VoxelBlocks>(std::move((*volumes)->packed));
    if (fault.error) return *fault.error;
    if (!small_parts) return small_parts.error();
    return out;
}

}  // namespace

Result<CaseBundle> read_bundle(std::span<const std::uint8_t> bytes,
                               const std::string& where,
                               JobRunner& jobs) {
    auto packed = read_packed(bytes, where, jobs);
    if (!packed) return packed.error();
    if (packed->blocks) {
        packed->blocks->load_all(jobs);
        if (Status whole = packed->blocks->status(); !whole) return whole.error();
    }
    return std::move(packed->bundle);
}

Result<StreamedBundle> stream_bundle(RawVector<std::uint8_t> bytes,
                                     const std::string& where,
                                     JobRunner& jobs) {
    auto packed = read_packed(bytes, where, jobs);
    if (!packed) return packed.error();
    StreamedBundle out;
    out.bundle_ = std::move(packed->bundle);
    if (packed->blocks) {
        packed->blocks->use_small_pages();
        out.blocks_ = std::move(packed->blocks);
        out.bytes_ = std::move(bytes);  // the storage stays where the blocks refer to it
    }
    return out;
}

}  // namespace sonocase
