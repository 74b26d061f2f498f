// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/packed_volumes.h"

#include <algorithm>
#include <span>

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/first_layout.h"
#include "formats/bundle/codec/pack_offsets.h"
#include "formats/bundle/codec/pack_surfaces.h"
#include "formats/bundle/codec/unpack_offsets.h"
#include "formats/bundle/codec/unpack_surfaces.h"

namespace sonocase::detail {
namespace {

constexpr int kLeastBlock = 8;  // bricks per edge
constexpr std::size_t kMostBlocks = 4096;
constexpr int kMostPatchStep = 16;

// Blocks small enough that a frame needs few, large enough that each compresses well.
BlockGrid block_grid(Int3 size) {
    BlockGrid grid{brick_count(size), kLeastBlock};
    while (grid.count() > kMostBlocks && grid.edge < kLargestBlock) grid.edge *= 2;
    return grid;
}

// The largest distance of any record, in 1/48 voxel.
int reach_of(const BrickVolume<std::uint32_t>& boundary) {
    std::uint32_t most = 0;
    const auto search = [&](std::span<const std::uint32_t> values) {
        for (const std::uint32_t v : values) {
            const std::uint32_t steps = v >> 8 & 0xFFu;
            if (steps < 128) most = std::max(most, steps);
        }
    };
    search(boundary.uniform);
    search(boundary.pool);
    return static_cast<int>(most);
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
    parts->grid.edge = static_cast<int>(manifest.integer("block_bricks", 1, kLargestBlock));
    const auto step = static_cast<int>(manifest.integer_or("patch_step", 1, 1, kMostPatchStep));
    if (!manifest.ok()) return VoxelVolumes{};
    parts->palette = palette;
    parts->where = reader.where();
    VoxelVolumes out;
    out.boundary.patches.step = step;
    out.labels.size = size;
    if (with_records) out.boundary.size = size;
    if (Status s = read_surfaces(reader, with_records, jobs, parts.get(), &out); !s)
        return s.error();
    if (with_offsets) {
        out.echo_offset.size = size;
        if (Status s = read_offsets(reader, jobs, parts.get(), &out.echo_offset); !s)
            return s.error();
    }
    out.packed = std::move(parts);
    return out;
}

}  // namespace sonocase::detail
