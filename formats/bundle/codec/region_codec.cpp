// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/region_codec.h"

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/packed_volumes.h"

namespace sonocase::detail {
namespace {

constexpr std::string_view kChunks[] = {"manifest", SONOCASE_VOLUME_CHUNKS};

// Unpacks every block at once: a region is small.
Status unpack_all(BlockParts& parts) {
    BlockUnpacker unpacker(parts);
    for (std::size_t block = 0; block < parts.grid.count(); ++block) {
        if (!unpacker.unpack(parts, block))
            return Error{"a block of the fine region is damaged", parts.where,
                         "copy the file again, or make it again"};
    }
    return Done{};
}

}  // namespace

std::vector<std::uint8_t> region_bytes(const FineRegion& region, JobRunner& jobs) {
    ChunkWriter writer("FINE");
    Json manifest = Json::object();
    manifest["format"] = "sonocase region";
    manifest["name"] = region.name;
    manifest["lower_mm"] = json_of(region.box.lower);
    manifest["upper_mm"] = json_of(region.box.upper);
    manifest["grid"] = json_of(region.grid);
    add_volumes(writer, manifest, region.label_bricks, region.boundary, {}, jobs);
    return writer.write(jobs);
}

Result<FineRegion> region_from_bytes(std::span<const std::uint8_t> bytes,
                                     std::size_t palette,
                                     double case_voxel_mm,
                                     const std::string& where,
                                     JobRunner& jobs) {
    const std::string place = where + ": fine region";
    SONOCASE_TRY(auto reader, ChunkReader::open(bytes, "FINE", kChunks, place));
    SONOCASE_TRY(auto json, read_manifest(reader));
    JsonFault fault{place + ": manifest", {}};
    JsonObject manifest(json, "", fault);
    FineRegion region;
    region.name = manifest.text_or("name", "");
    region.box.lower = manifest.point("lower_mm");
    region.box.upper = manifest.point("upper_mm");
    region.grid = grid_from(manifest.object("grid"));
    if (fault.error) return *fault.error;
    SONOCASE_TRY_DONE(check_region(region, case_voxel_mm, place));
    if (!reader.has("vox.kind"))
        return reader.fault("holds no labels of the fine region", "make the file again");
    auto volumes = read_volumes(reader, manifest, region.grid.size, palette, jobs);
    if (fault.error) return *fault.error;
    if (!volumes) return volumes.error();
    SONOCASE_TRY_DONE(unpack_all(*volumes->packed));
    region.label_bricks = std::move(volumes->labels);
    region.boundary = std::move(volumes->boundary);
    return region;
}

}  // namespace sonocase::detail
