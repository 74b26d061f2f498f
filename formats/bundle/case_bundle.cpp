// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/case_bundle.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/bundle/codec/region_codec.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

// The answer key, for other programs: what the stage "pathology" reports of each lesion, as an
// object of its own. Our readers take it from the stage's report.
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
        if (!report.groups.empty() && report.stage == stage_names::kPathology)
            out["pathology"] = pathology_of(report);
    }
    if (const std::string text = attribution_of(bundle); !text.empty()) out["attribution"] = text;
    return out;
}

}  // namespace

std::string attribution_of(const CaseBundle& bundle) {
    for (const StageReport& report : bundle.manifest.stages)
        for (const Note& note : report.notes)
            if (report.stage == stage_names::kImport && note.name == "attribution")
                return note.text;
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

namespace {

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
        manifest.add_fault("grid", "has voxels that are not cubes", "cook the case again");
    }
    if (grid.direction != Matrix3{}) {
        manifest.add_fault("grid", "is rotated relative to its frame", "cook the case again");
    }
    for (const Label& label : bundle.labels) {
        bool found = false;
        for (const Tissue& tissue : bundle.tissues) found |= tissue.name == label.tissue;
        if (!found) {
            manifest.add_fault("labels",
                               "name the tissue '" + label.tissue + "', which is not in the table");
        }
    }
}

// Fine region, textures, surfaces and preview: small enough for one thread. The first picture of
// model `physical` needs none of them but the region. `read` reads one chunk, and does nothing
// where the bundle has none.
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
                  SONOCASE_TRY(const auto bytes, r.read("region", detail::kMaxRegionBytes));
                  SONOCASE_TRY(auto region, detail::region_from_bytes(bytes, b.labels.size(),
                                                                      b.grid.spacing_mm.x,
                                                                      r.where(), serial_jobs()));
                  b.region = std::move(region);
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
                  SONOCASE_TRY(const auto bytes, r.read("flow", detail::kMaxFlowBytes));
                  return put(detail::flow_from_bytes(bytes, r.where()), b.flow);
              }},
    SmallPart{"preview",
              [](CaseBundle& b, const ChunkReader& r, JsonObject&) -> Status {
                  if (!r.has("preview")) return Done{};
                  return put(r.read("preview", kMaxPreviewBytes), b.preview_png);
              }},
};

// Reads those of `pending` whose bytes have arrived, in their order, and takes them off the list.
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
            part->type == std::string_view("skin.fit") && !reader.is_loaded("skin.pat");
        if (waits || !reader.is_loaded(part->type)) return false;
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
    // What read_small_parts() needs later.
    ChunkReader reader;
    Json json;
    std::vector<const SmallPart*> pending = all_small_parts();
};

Result<PackedBundle> read_packed(std::span<const std::uint8_t> bytes,
                                 const Arrivals* arrivals,
                                 const std::string& where,
                                 JobRunner& jobs) {
    SONOCASE_TRY(auto reader, ChunkReader::open(bytes, "CASE", kKnownChunks, where, arrivals));
    SONOCASE_TRY(auto json, detail::read_manifest(reader));
    PackedBundle out{{}, {}, std::move(reader), std::move(json)};
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
    SONOCASE_TRY(auto packed, read_packed(bytes, nullptr, where, jobs));
    if (packed.blocks) {
        packed.blocks->load_all(jobs);
        SONOCASE_TRY_DONE(packed.blocks->status());
    }
    return std::move(packed.bundle);
}

struct StreamedBundle::Arriving {
    Arrivals arrivals;
    std::optional<PackedBundle> packed;  // what is left to read; its bundle was moved out

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

Status StreamedBundle::read_arrived() {
    if (blocks_) blocks_->read_arrived();
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
    SONOCASE_TRY(auto packed, read_packed(bytes, nullptr, where, jobs));
    StreamedBundle out;
    out.bundle_ = std::move(packed.bundle);
    if (packed.blocks) {
        packed.blocks->use_small_pages();
        out.blocks_ = std::move(packed.blocks);
    }
    out.bytes_ = std::move(bytes);  // the storage stays where the blocks refer to it
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
    SONOCASE_TRY(auto packed, read_packed(bytes, &out.arriving_->arrivals, where, jobs));
    out.bytes_ = std::move(bytes);
    out.bundle_ = std::move(packed.bundle);
    out.blocks_ = std::move(packed.blocks);
    if (out.blocks_) out.blocks_->use_small_pages();
    out.arriving_->packed = std::move(packed);
    return out;
}

namespace {

// The chunks in the order in which a player that loads a bundle in parts needs them: those that it
// reads whole before the first picture, those that it reads block by block, and those that may come
// later.
constexpr std::array<std::string_view, 10> kAtOnce{"manifest", "vox.kind", "vox.one",  "vox.mix",
                                                   "vox.pair", "vox.low",  "vox.high", "ofs.kind",
                                                   "ofs.one",  "region"};
constexpr std::array<std::string_view, 2> kInBlocks{"vox.fix", "ofs.val"};
constexpr std::array<std::string_view, 7> kLater{"textures", "flow",     "skin.pat", "skin.fit",
                                                 "speckle",  "skin.man", "preview"};
constexpr int kZstdLevel = 22;  // the highest: chunks are few and packed once

// The first layout has no blocks: all of its volumes come first.
constexpr std::array<std::string_view, 9> kFirstLayout{
    "lab.t", "lab.u", "lab.p", "echo.t", "echo.u", "echo.p", "bnd.t", "bnd.u", "bnd.p"};

std::vector<std::string_view> all_chunks() {
    std::vector<std::string_view> out(kAtOnce.begin(), kAtOnce.end());
    out.insert(out.end(), kFirstLayout.begin(), kFirstLayout.end());
    out.insert(out.end(), kInBlocks.begin(), kInBlocks.end());
    out.insert(out.end(), kLater.begin(), kLater.end());
    return out;
}

}  // namespace

Result<std::vector<ByteRange>> parts_to_open(std::span<const std::uint8_t> bytes,
                                             const std::string& where) {
    const std::vector<std::string_view> known = all_chunks();
    SONOCASE_TRY(const auto reader, ChunkReader::open(bytes, "CASE", known, where));
    SONOCASE_TRY(const auto json, detail::read_manifest(reader));
    detail::JsonFault fault{where + ": manifest", {}};
    detail::JsonObject manifest(json, "", fault);
    detail::BlockGrid grid;
    grid.bricks = brick_count(detail::grid_from(manifest.object("grid")).size);
    if (reader.has("vox.kind"))
        grid.edge = static_cast<int>(manifest.integer("block_bricks", 1, detail::kMaxBlock));
    if (fault.error) return *fault.error;

    std::vector<ByteRange> out{{0, reader.place("manifest").at}};  // header and table
    const auto add = [&](std::string_view type, std::size_t max_bytes) {
        const ByteRange place = reader.place(type);
        out.push_back({place.at, std::min(place.count, max_bytes)});
    };
    for (const std::string_view type : kAtOnce) add(type, SIZE_MAX);
    for (const std::string_view type : kFirstLayout) add(type, SIZE_MAX);
    for (const std::string_view type : kInBlocks) add(type, 4 * grid.count());  // sizes of blocks
    if (reader.place("textures").at < reader.place(kInBlocks[0]).at)
        add("textures", SIZE_MAX);  // arranged_for_loading() puts them first where they are needed
    std::erase_if(out, [](const ByteRange& r) { return r.count == 0; });
    std::sort(out.begin(), out.end(),
              [](const ByteRange& a, const ByteRange& b) { return a.at < b.at; });
    std::vector<ByteRange> joined;
    for (const ByteRange& range : out) {
        // What lies between neighbouring chunks is padding.
        if (!joined.empty() && range.at <= joined.back().end() + kChunkAlignment) {
            joined.back().count = std::max(joined.back().end(), range.end()) - joined.back().at;
        } else {
            joined.push_back(range);
        }
    }
    return joined;
}

Result<std::vector<std::uint8_t>> arranged_for_loading(std::span<const std::uint8_t> bytes,
                                                       bool textures_at_once,
                                                       const std::string& where,
                                                       JobRunner& jobs) {
    std::vector<std::string_view> order(kAtOnce.begin(), kAtOnce.end());
    if (textures_at_once) order.push_back("textures");
    order.insert(order.end(), kInBlocks.begin(), kInBlocks.end());
    order.insert(order.end(), kLater.begin(), kLater.end());
    return rearranged(bytes, "CASE", order, kZstdLevel, where, jobs);
}

}  // namespace sonocase
