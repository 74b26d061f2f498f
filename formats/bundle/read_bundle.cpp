// SPDX-License-Identifier: Apache-2.0

// The readers of case_bundle.h and streamed_bundle.h.
#include <algorithm>
#include <array>
#include <optional>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/bundle/codec/region_codec.h"
#include "formats/bundle/codec/volume_json.h"
#include "formats/bundle/streamed_bundle.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr std::string_view kKnownChunks[] = {"manifest", SONOCASE_VOLUME_CHUNKS,
                                             "region",   "textures",
                                             "speckle",  "skin.pat",
                                             "skin.fit", "skin.man",
                                             "flow",     "preview"};
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

// Fine region, textures, surfaces and preview: small enough for one thread, and, but for the
// region, not needed by the first picture of model `physical`. Each step reads one chunk, and
// nothing where the bundle has none.
struct SmallPart {
    const char* type;
    Status (*read)(CaseBundle&, const ChunkReader&, JsonObject& manifest);
};

template <class Value>
Status put(Result<Value> from, Value& to) {
    if (!from) return from.error();
    to = std::move(*from);
    return Done{};
}

constexpr std::array kSmallParts{
    SmallPart{"region",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) -> Status {
                  if (!r.has("region")) return Done{};
                  const auto bytes = r.read("region", detail::kMaxRegionBytes);
                  if (!bytes) return bytes.error();
                  auto region = detail::region_from_bytes(
                      *bytes, b.labels.size(), b.grid.spacing_mm.x, r.where(), serial_jobs());
                  if (!region) return region.error();
                  b.region = std::move(*region);
                  return Done{};
              }},
    SmallPart{"textures",
              [](CaseBundle& b, const ChunkReader& r, JsonObject& manifest) {
                  return put(detail::read_textures(r, manifest), b.textures);
              }},
    SmallPart{"speckle",
              [](CaseBundle& b, const ChunkReader& r, JsonObject& manifest) {
                  return put(detail::read_speckle(r, manifest), b.speckle);
              }},
    SmallPart{"skin.pat",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) {
                  return put(detail::read_surface(r, "skin.pat"), b.patient_skin);
              }},
    SmallPart{"skin.fit",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) -> Status {
                  if (!r.has("skin.fit")) return Done{};
                  return put(r.read_array<std::uint8_t>("skin.fit", b.patient_skin.points.size()),
                             b.skin_unfitted);
              }},
    SmallPart{"skin.man",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) {
                  return put(detail::read_surface(r, "skin.man"), b.mannequin_skin);
              }},
    SmallPart{"flow",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) -> Status {
                  if (!r.has("flow")) return Done{};
                  const auto bytes = r.read("flow", detail::kMaxFlowBytes);
                  if (!bytes) return bytes.error();
                  return put(detail::flow_from_bytes(*bytes, r.where()), b.flow);
              }},
    SmallPart{"preview",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) -> Status {
                  if (!r.has("preview")) return Done{};
                  return put(r.read("preview", kMaxPreviewBytes), b.preview_png);
              }},
};

// Reads those of `pending` whose bytes are there, in their order, and takes them off the list.
// "skin.fit" belongs to the points of "skin.pat" and waits for them.
Status read_small_parts(std::vector<const SmallPart*>& pending,
                        CaseBundle& bundle,
                        const ChunkReader& reader,
                        const Json& json) {
    JsonFault fault{reader.where() + ": manifest", {}};
    JsonObject manifest(json, "", fault);
    Status first_fault = Done{};
    std::erase_if(pending, [&](const SmallPart* part) {
        const bool waits =
            part->type == std::string_view("skin.fit") && !reader.is_here("skin.pat");
        if (waits || !reader.is_here(part->type)) return false;
        Status read = part->read(bundle, reader, manifest);
        if (fault.error) read = *fault.error;
        if (!read && first_fault) first_fault = read;
        return true;
    });
    return first_fault;
}

std::vector<const SmallPart*> all_small_parts() {
    std::vector<const SmallPart*> out;
    for (const SmallPart& part : kSmallParts) out.push_back(&part);
    return out;
}

// A bundle whose blocks are still packed; blocks is null where the file's layout has none.
struct PackedBundle {
    CaseBundle bundle;
    std::unique_ptr<VoxelBlocks> blocks;
    // For what is read later.
    ChunkReader reader;
    Json json;
    std::vector<const SmallPart*> pending = all_small_parts();
};

Result<PackedBundle> read_packed(std::span<const std::uint8_t> bytes,
                                 const Arrivals* arrivals,
                                 const std::string& where,
                                 JobRunner& jobs) {
    auto reader = ChunkReader::open(bytes, "CASE", kKnownChunks, where, arrivals);
    if (!reader) return reader.error();
    auto json = detail::read_manifest(*reader);
    if (!json) return json.error();
    PackedBundle out{{}, {}, std::move(*reader), std::move(*json)};
    CaseBundle& bundle = out.bundle;
    JsonFault fault{where + ": manifest", {}};
    JsonObject manifest(out.json, "", fault);
    read_manifest_into(bundle, manifest);
    if (fault.error) return *fault.error;
    std::optional<Result<detail::VoxelVolumes>> volumes;
    Status small_parts = Done{};
    jobs.run(2, [&](std::size_t job) {
        if (job == 1) {
            small_parts = read_small_parts(out.pending, bundle, out.reader, out.json);
        } else {
            volumes = detail::read_volumes(out.reader, manifest, bundle.grid.size,
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
    auto packed = read_packed(bytes, nullptr, where, jobs);
    if (!packed) return packed.error();
    if (packed->blocks) {
        packed->blocks->load_all(jobs);
        if (Status whole = packed->blocks->status(); !whole) return whole.error();
    }
    return std::move(packed->bundle);
}

struct StreamedBundle::Arriving {
    Arrivals arrivals;
    std::optional<PackedBundle> packed;  // what is left to read; its bundle has moved on

    bool has(std::string_view type) const {
        const auto& pending = packed->pending;
        return std::none_of(pending.begin(), pending.end(),
                            [&](const SmallPart* part) { return part->type == type; });
    }
};

StreamedBundle::StreamedBundle() = default;
StreamedBundle::StreamedBundle(CaseBundle whole) : bundle_(std::move(whole)) {}
StreamedBundle::~StreamedBundle() = default;
StreamedBundle::StreamedBundle(StreamedBundle&&) noexcept = default;
StreamedBundle& StreamedBundle::operator=(StreamedBundle&&) noexcept = default;

const Arrivals* StreamedBundle::arrivals() const {
    return arriving_ ? &arriving_->arrivals : nullptr;
}

void StreamedBundle::arrived(std::size_t segment) {
    arriving_->arrivals.add(segment);
}

Status StreamedBundle::look_again() {
    if (blocks_) blocks_->look_again();
    PackedBundle& rest = *arriving_->packed;
    return read_small_parts(rest.pending, bundle_, rest.reader, rest.json);
}

bool StreamedBundle::has_textures() const {
    return !arriving_ || arriving_->has("textures");
}

bool StreamedBundle::has_flow() const {
    return !arriving_ || arriving_->has("flow");
}

Result<StreamedBundle> stream_bundle(RawVector<std::uint8_t> bytes,
                                     const std::string& where,
                                     JobRunner& jobs) {
    auto packed = read_packed(bytes, nullptr, where, jobs);
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

void rehearse_opening(std::span<const std::uint8_t> bytes, const Arrivals& arrivals) {
    (void)read_packed(bytes, &arrivals, "", serial_jobs());
}

Result<StreamedBundle> stream_bundle_in_parts(RawVector<std::uint8_t> bytes,
                                              Arrivals arrivals,
                                              const std::string& where,
                                              JobRunner& jobs) {
    StreamedBundle out;
    out.arriving_.reset(new StreamedBundle::Arriving{std::move(arrivals), {}});
    auto packed = read_packed(bytes, &out.arriving_->arrivals, where, jobs);
    if (!packed) return packed.error();
    out.bytes_ = std::move(bytes);
    out.bundle_ = std::move(packed->bundle);
    out.blocks_ = std::move(packed->blocks);
    if (out.blocks_) out.blocks_->use_small_pages();
    out.arriving_->packed = std::move(*packed);
    return out;
}

}  // namespace sonocase
