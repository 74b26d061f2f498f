// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/packed_volumes.h"

#include <algorithm>
#include <span>

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/offset_codec.h"
#include "formats/bundle/codec/surface_codec.h"
#include "formats/volume/boundary_record.h"

namespace sonocase::detail {
namespace {

template <class T, class Good>
bool all_values(const BrickVolume<T>& bricks, Good good) {
    return std::all_of(bricks.uniform.begin(), bricks.uniform.end(), good) &&
           std::all_of(bricks.pool.begin(), bricks.pool.end(), good);
}

// Files of the first layout hold brick volumes as chunks lab.*, bnd.* and echo.* with tables,
// uniform values and pools as they are in memory. Such files are read but no longer written.
Result<VoxelVolumes> read_first_layout(const ChunkReader& reader,
                                       bool with_records,
                                       bool with_offsets,
                                       Int3 size,
                                       std::size_t palette,
                                       JobRunner& jobs) {
    VoxelVolumes out;
    SONOCASE_TRY(auto labels, read_bricks<std::uint8_t>(reader, "lab", size, jobs));
    out.labels = std::move(labels);
    if (!all_values(out.labels, [&](std::uint8_t v) { return v < palette; }))
        return reader.fault("a voxel has a label beyond the palette", "make the file again");
    if (with_offsets) {
        SONOCASE_TRY(auto echo, read_bricks<std::int8_t>(reader, "echo", size, jobs));
        out.echo_offset = std::move(echo);
    }
    if (with_records) {
        SONOCASE_TRY(auto boundary, read_bricks<std::uint32_t>(reader, "bnd", size, jobs));
        out.boundary = std::move(boundary);
        if (!all_values(out.boundary, [&](std::uint32_t v) {
                return (v & 0xFFu) < palette || v == kNoBoundary;
            })) {
            return reader.fault("a boundary record has a label beyond the palette",
                                "make the file again");
        }
    }
    return out;
}

constexpr int kMinBlock = 8;  // bricks per edge
constexpr std::size_t kMaxBlocks = 4096;
constexpr int kMaxPatchStep = 16;

// Blocks small enough that a frame of the player needs few, large enough that each compresses well.
BlockGrid block_grid(Int3 size) {
    BlockGrid grid{brick_count(size), kMinBlock};
    while (grid.count() > kMaxBlocks && grid.edge < kMaxBlock) grid.edge *= 2;
    return grid;
}

// The largest distance of any record, in 1/48 voxel.
int reach_of(const BrickVolume<std::uint32_t>& boundary) {
    std::uint32_t max_steps = 0;
    const auto search = [&](std::span<const std::uint32_t> values) {
        for (const std::uint32_t v : values) {
            const std::uint32_t steps = v >> 8 & 0xFFu;
            if (steps < 128) max_steps = std::max(max_steps, steps);
        }
    };
    search(boundary.uniform);
    search(boundary.pool);
    return static_cast<int>(max_steps);
}

}  // namespace

void add_volumes(ChunkWriter& writer,
                 Json& manifest,
                 const BrickVolume<std::uint8_t>& labels,
                 const BoundaryBricks& boundary,
                 const BrickVolume<std::int8_t>& echo_offset,
                 JobRunner& jobs) {
    const BlockGrid grid = block_grid(labels.size);
    const int reach_steps = reach_of(boundary);
    manifest["echo_offset"] = !echo_offset.table.empty();
    manifest["boundary"] = !boundary.table.empty();
    manifest["record_reach"] = reach_steps;
    manifest["patch_step"] = boundary.patches.step;
    manifest["block_bricks"] = grid.edge;
    add_manifest(writer, manifest);
    add_surfaces(writer, grid, labels, boundary, reach_steps, jobs);
    if (!echo_offset.table.empty()) add_offsets(writer, grid, echo_offset, jobs);
}

Result<VoxelVolumes> read_volumes(const ChunkReader& reader,
                                  JsonObject& manifest,
                                  Int3 size,
                                  std::size_t palette,
                                  JobRunner& jobs) {
    const bool with_offsets = manifest.flag_or("echo_offset", false);
    const bool with_records = manifest.flag_or("boundary", false);
    if (!reader.has("vox.kind"))
        return read_first_layout(reader, with_records, with_offsets, size, palette, jobs);
    if (reader.has("vox.rec")) {
        return reader.fault("is of an early layout that is no longer read", "make the file again");
    }
    auto parts = std::make_unique<BlockParts>();
    parts->reach_steps = static_cast<int>(manifest.integer("record_reach", 0, 127));
    parts->grid.bricks = brick_count(size);
    parts->grid.edge = static_cast<int>(manifest.integer("block_bricks", 1, kMaxBlock));
    const auto step = static_cast<int>(manifest.integer_or("patch_step", 1, 1, kMaxPatchStep));
    if (!manifest.ok()) return VoxelVolumes{};
    parts->palette = palette;
    parts->where = reader.where();
    VoxelVolumes out;
    out.boundary.patches.step = step;
    out.labels.size = size;
    if (with_records) out.boundary.size = size;
    SONOCASE_TRY_DONE(read_surfaces(reader, with_records, jobs, parts.get(), &out));
    if (with_offsets) {
        out.echo_offset.size = size;
        SONOCASE_TRY_DONE(read_offsets(reader, jobs, parts.get(), &out.echo_offset));
    }
    out.packed = std::move(parts);
    return out;
}

}  // namespace sonocase::detail
