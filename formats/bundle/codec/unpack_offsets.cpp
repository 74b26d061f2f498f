// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/unpack_offsets.h"

#include <vector>

#include "formats/base/memory.h"
#include "formats/bundle/codec/brick_kinds.h"
#include "formats/bundle/codec/value_order.h"

namespace sonocase::detail {

Status read_offsets(const ChunkReader& reader,
                    JobRunner& jobs,
                    BlockParts* parts,
                    BrickVolume<std::int8_t>* out) {
    using Bytes = RawVector<std::uint8_t>;
    const std::size_t layer = layer_bricks(parts->grid.bricks),
                      layers = static_cast<std::size_t>(parts->grid.bricks.z);
    const auto kind = reader.read_array<std::uint8_t, Bytes>("ofs.kind", layer * layers, jobs);
    if (!kind) return kind.error();
    const LayerKinds kinds(*kind, layer, jobs);
    std::vector<std::size_t> first_one(layers + 1);
    std::size_t known = 0;
    for (std::size_t k = 0; k < layers; ++k) {
        first_one[k + 1] = first_one[k] + kinds.count(k, kOneOffset);
        for (unsigned v = 0; v < kOffsetKinds; ++v) known += kinds.count(k, v);
    }
    if (known != kind->size())
        return reader.fault("a brick of 'ofs.kind' is of an unknown kind", "make it again");
    const auto one = reader.read_array<std::uint8_t, Bytes>("ofs.one", first_one[layers], jobs);
    if (!one) return one.error();
    auto frames = BlockFrames::open(reader, "ofs.val", parts->grid.count(),
                                    parts->grid.block_bricks() * kBrickVoxels);
    if (!frames) return frames.error();
    parts->offsets = std::move(*frames);

    ValueOrder order;
    for (std::size_t k = 0; k < layers; ++k) {
        if (kinds.begins_as_before(k, [](unsigned v) { return v; })) order.met(0);
        for (std::size_t n = first_one[k]; n < first_one[k + 1]; ++n) order.met((*one)[n]);
    }
    for (const std::uint8_t v : order.values()) out->uniform.push_back(static_cast<std::int8_t>(v));
    PoolOrder places(*kind, parts->grid, jobs, [](unsigned v) { return v >= kMixedOffsets; });
    if (!can_allocate(places.total() * kBrickVoxels))
        return reader.fault("needs more memory than is available", "use larger voxels");
    out->table.resize(kind->size());
    out->pool.resize(places.total() * kBrickVoxels);
    if (!out->pool.empty()) out->pool[0] = 0;  // renderers read it where they do not use it
    parts->in_cells.resize(places.total());
    jobs.run(layers, [&](std::size_t k) {
        std::size_t next_one = first_one[k];
        std::uint32_t before = kUniformBrick | order.index()[0];
        std::size_t b = k * layer;
        for (int j = 0; j < parts->grid.bricks.y; ++j) {
            PoolOrder::Row row = places.row(k, j);
            for (int i = 0; i < parts->grid.bricks.x; ++i, ++b) {
                const unsigned v = (*kind)[b];
                if (v == kOneOffset) before = kUniformBrick | order.index()[(*one)[next_one++]];
                if (v <= kOneOffset) {
                    out->table[b] = before;
                } else {
                    const std::uint32_t place = row.next(i);
                    parts->in_cells[place] = v == kCells;
                    out->table[b] = place;
                }
            }
        }
    });
    parts->echo = BrickSpans(*out);
    return Done{};
}

}  // namespace sonocase::detail
