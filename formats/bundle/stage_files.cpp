// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/stage_files.h"

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/bundle/codec/region_codec.h"
#include "formats/bundle/voxel_blocks.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr std::string_view kLabelChunks[] = {"manifest", SONOCASE_VOLUME_CHUNKS, "region"};
constexpr std::string_view kTextureChunks[] = {"manifest", "textures", "speckle"};
constexpr std::string_view kSurfaceChunks[] = {"manifest", "surface"};

// Opens the container, reads its manifest and passes both to `fill`. An error in the manifest takes
// precedence over one in the chunks.
template <class File, class Fill>
Result<File> read_container(std::span<const std::uint8_t> bytes,
                            std::string_view kind,
                            std::span<const std::string_view> known,
                            const std::string& where,
                            Fill fill) {
    SONOCASE_TRY(const auto reader, ChunkReader::open(bytes, kind, known, where));
    SONOCASE_TRY(const auto json, detail::read_manifest(reader));
    JsonFault fault{where + ": manifest", {}};
    JsonObject manifest(json, "", fault);
    File file;
    const Status filled = fill(file, reader, manifest);
    if (fault.error) return *fault.error;
    if (!filled) return filled.error();
    return file;
}

Status fill_labels(LabelFile& file,
                   const ChunkReader& reader,
                   JsonObject& manifest,
                   JobRunner& jobs) {
    file.frame = manifest.text_or("frame", "");
    file.volume.grid = detail::grid_from(manifest.object("grid"));
    file.volume.labels = detail::labels_from(manifest, "labels");
    file.reports = detail::reports_from(manifest, "stages");
    if (!manifest.ok()) return Done{};
    const Int3 size = file.volume.grid.size;
    SONOCASE_TRY(auto volumes,
                 detail::read_volumes(reader, manifest, size, file.volume.labels.size(), jobs));
    if (volumes.packed) {
        VoxelBlocks blocks(std::move(volumes.packed));
        blocks.load_all(jobs);
        SONOCASE_TRY_DONE(blocks.status());
    }
    file.volume.voxels = dense_from_bricks(volumes.labels);
    file.boundary = std::move(volumes.boundary);
    file.echo_offset = std::move(volumes.echo_offset);
    if (!reader.has("region")) return Done{};
    SONOCASE_TRY(const auto bytes, reader.read("region", detail::kMaxRegionBytes, jobs));
    SONOCASE_TRY(auto region,
                 detail::region_from_bytes(bytes, file.volume.labels.size(),
                                           file.volume.grid.spacing_mm.x, reader.where(), jobs));
    file.region = std::move(region);
    return Done{};
}

Status fill_textures(TextureFile& file, const ChunkReader& reader, JsonObject& manifest) {
    file.reports = detail::reports_from(manifest, "stages");
    file.tissues = detail::tissues_from(manifest, "tissues");
    SONOCASE_TRY(auto textures, detail::read_textures(reader, manifest));
    file.textures = std::move(textures);
    SONOCASE_TRY(auto speckle, detail::read_speckle(reader, manifest));
    file.speckle = std::move(speckle);
    return Done{};
}

Status fill_surface(SurfaceFile& file, const ChunkReader& reader, JsonObject& manifest) {
    file.frame = manifest.text_or("frame", "");
    file.reports = detail::reports_from(manifest, "stages");
    SONOCASE_TRY(auto surface, detail::read_surface(reader, "surface"));
    file.surface = std::move(surface);
    return Done{};
}

}  // namespace

std::vector<std::uint8_t> write_label_file(const LabelFile& file, JobRunner& jobs) {
    Json manifest = Json::object();
    manifest["format"] = "sonocase labels";
    manifest["frame"] = file.frame;
    manifest["grid"] = detail::json_of(file.volume.grid);
    manifest["labels"] = detail::json_of(file.volume.labels);
    manifest["stages"] = detail::json_of(file.reports);
    const BrickVolume<std::uint8_t> bricks =
        bricks_from_dense<std::uint8_t>(file.volume.voxels, file.volume.grid.size);
    ChunkWriter writer("LABL");
    detail::add_volumes(writer, manifest, bricks, file.boundary, file.echo_offset, jobs);
    if (file.region) writer.add("region", false, detail::region_bytes(*file.region, jobs));
    return writer.write(jobs);
}

Result<LabelFile> read_label_file(std::span<const std::uint8_t> bytes,
                                  const std::string& where,
                                  JobRunner& jobs) {
    const auto fill = [&](LabelFile& file, const ChunkReader& reader, JsonObject& manifest) {
        return fill_labels(file, reader, manifest, jobs);
    };
    return read_container<LabelFile>(bytes, "LABL", kLabelChunks, where, fill);
}

std::vector<std::uint8_t> write_texture_file(const TextureFile& file, JobRunner& jobs) {
    Json manifest = Json::object();
    manifest["format"] = "sonocase textures";
    manifest["textures"] = detail::json_of_textures(file.textures);
    manifest["speckle_edge"] = file.speckle.edge;
    manifest["tissues"] = detail::json_of(file.tissues);
    manifest["stages"] = detail::json_of(file.reports);
    ChunkWriter writer("TXTR");
    detail::add_manifest(writer, manifest);
    if (!file.textures.empty()) detail::add_textures(writer, file.textures);
    if (file.speckle.edge != 0) writer.add_array("speckle", false, file.speckle.voxels);
    return writer.write(jobs);
}

Result<TextureFile> read_texture_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where) {
    return read_container<TextureFile>(bytes, "TXTR", kTextureChunks, where, fill_textures);
}

std::vector<std::uint8_t> write_surface_file(const SurfaceFile& file, JobRunner& jobs) {
    Json manifest = Json::object();
    manifest["format"] = "sonocase surface";
    manifest["frame"] = file.frame;
    manifest["stages"] = detail::json_of(file.reports);
    ChunkWriter writer("SURF");
    detail::add_manifest(writer, manifest);
    detail::add_surface(writer, "surface", file.surface);
    return writer.write(jobs);
}

Result<SurfaceFile> read_surface_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where) {
    return read_container<SurfaceFile>(bytes, "SURF", kSurfaceChunks, where, fill_surface);
}

std::string container_kind(std::span<const std::uint8_t> bytes) {
    constexpr std::uint8_t kMagic[] = {0x89, 'S', 'O', 'N', 'O', 0x0D, 0x0A, 0x1A};
    if (bytes.size() < 16 || !std::equal(std::begin(kMagic), std::end(kMagic), bytes.begin()))
        return "";
    return {reinterpret_cast<const char*>(bytes.data()) + 12, 4};
}

}  // namespace sonocase
