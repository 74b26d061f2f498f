// SPDX-License-Identifier: Apache-2.0

// What case bundles and the files between stages have in common: grids, labels and tissues as JSON,
// and chunks of bricks, textures and surfaces. For the .cpp files of formats/ only.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "formats/bundle/codec/chunk_file.h"
#include "formats/text/json_reader.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/solid_texture.h"
#include "formats/volume/surface.h"
#include "formats/volume/tissue.h"

namespace sonocase::detail {

Json json_of(const Grid& grid);
Grid grid_from(JsonObject object);
Json json_of(const std::vector<Label>& labels);
std::vector<Label> labels_from(JsonObject& object, const char* key);
Json json_of(const std::vector<Tissue>& tissues);
std::vector<Tissue> tissues_from(JsonObject& object, const char* key);

inline constexpr std::size_t kMaxManifestBytes = std::size_t{64} << 20;
inline constexpr std::size_t kMaxSurfaceItems = std::size_t{1} << 27;

void add_manifest(ChunkWriter& writer, const Json& manifest);
Result<Json> read_manifest(const ChunkReader& reader);

// The first layout: a brick volume is three chunks, NAME.t, NAME.u and NAME.p.
// size: from the manifest. Every table entry is checked, so that at() stays inside.
template <class T>
Result<BrickVolume<T>> read_bricks(const ChunkReader& reader,
                                   const std::string& name,
                                   Int3 size,
                                   JobRunner& jobs) {
    BrickVolume<T> bricks;
    bricks.size = size;
    const Int3 n = brick_count(size);
    const std::size_t count = static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) *
                              static_cast<std::size_t>(n.z);
    SONOCASE_TRY(auto table, reader.read_array<std::uint32_t, RawVector<std::uint32_t>>(
                                 name + ".t", count, jobs));
    const std::size_t uniform_count = reader.raw_bytes(name + ".u") / sizeof(T);
    const std::size_t pool_count = reader.raw_bytes(name + ".p") / sizeof(T);
    if (uniform_count > count || pool_count > count * kBrickVoxels ||
        pool_count % kBrickVoxels != 0) {
        return reader.fault(
            "brick volume '" + name + "' holds " + std::to_string(pool_count) + " values",
            "whole bricks, and no more than its grid has");
    }
    SONOCASE_TRY(auto uniform, reader.read_array<T>(name + ".u", uniform_count, jobs));
    SONOCASE_TRY(auto pool, reader.read_array<T, RawVector<T>>(name + ".p", pool_count, jobs));
    const std::size_t stored = pool_count / kBrickVoxels;
    bool inside = true;
    for (const std::uint32_t entry : table) {
        const bool is_uniform = (entry & kUniformBrick) != 0;
        inside &= (entry & ~kUniformBrick) < (is_uniform ? uniform_count : stored);
    }
    if (!inside) {
        return reader.fault("brick volume '" + name + "' names a brick that it does not hold",
                            "make the file again");
    }
    bricks.table = std::move(table);
    bricks.uniform = std::move(uniform);
    bricks.pool = std::move(pool);
    return bricks;
}

// Textures lie one after another in one chunk, in the order of the manifest's list.
Json json_of_textures(const std::vector<SolidTexture>& textures);
void add_textures(ChunkWriter& writer, const std::vector<SolidTexture>& textures);
Result<std::vector<SolidTexture>> read_textures(const ChunkReader& reader, JsonObject& manifest);
Result<SpeckleVolume> read_speckle(const ChunkReader& reader, JsonObject& manifest);

// A surface is one chunk: u64 points, u64 normals, u64 triangles, then f64 x 3, f64 x 3, u32 x 3
// each.
void add_surface(ChunkWriter& writer, const std::string& type, const Surface& surface);
Result<Surface> read_surface(const ChunkReader& reader, const std::string& type);

}  // namespace sonocase::detail
