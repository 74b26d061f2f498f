// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/offset_codec.h"

#include <array>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/memory.h"
#include "formats/bundle/codec/brick_kinds.h"

namespace sonocase::detail {
namespace {

using Values = std::array<std::int8_t, kBrickVoxels>;

// Whether the brick is 8 cells of equal voxels, and the cells.
bool cells_of(const Values& values, std::array<std::int8_t, 8>* cells) {
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        const std::size_t i = v % 4, j = v / 4 % 4, k = v / 16;
        const std::size_t first = (i & 2u) + 4 * (j & 2u) + 16 * (k & 2u);
        if (values[v] != values[first]) return false;
        (*cells)[i / 2 + 2 * (j / 2) + 4 * (k / 2)] = values[first];
    }
    return true;
}

struct Kinds {  // of one layer
    std::vector<std::uint8_t> kind, one;
};

Kinds kinds_of_layer(const BrickVolume<std::int8_t>& volume, int layer) {
    Kinds out;
    const std::size_t count = layer_bricks(brick_count(volume.size));
    std::int8_t before = 0;
    for (std::size_t b = 0; b < count; ++b) {
        Values values;
        std::array<std::int8_t, 8> cells;
        brick_values(volume, static_cast<std::size_t>(layer) * count + b, values.data());
        if (!all_alike(values.data())) {
            out.kind.push_back(cells_of(values, &cells) ? kCells : kMixedOffsets);
            continue;
        }
        out.kind.push_back(values[0] == before ? kOffsetAsBefore : kOneOffset);
        if (values[0] != before) out.one.push_back(static_cast<std::uint8_t>(values[0]));
        before = values[0];
    }
    return out;
}

void add_values(const BlockGrid& grid,
                std::size_t block,
                const BrickVolume<std::int8_t>& volume,
                std::vector<std::uint8_t>* out) {
    grid.each_brick(block, [&](std::size_t brick, bool has_left, bool has_front) {
        Values values, left, front;
        std::array<std::int8_t, 8> cells;
        brick_values(volume, brick, values.data());
        if (all_alike(values.data())) return;
        if (has_left) brick_values(volume, brick - 1, left.data());
        if (has_front)
            brick_values(volume, brick - static_cast<std::size_t>(grid.bricks.x), front.data());
        const std::int8_t* at_left = has_left ? left.data() : nullptr;
        const std::int8_t* in_front = has_front ? front.data() : nullptr;
        const auto coded = [&](const std::int8_t* from) {
            return [out, from](int v, std::uint8_t prediction) {
                out->push_back(static_cast<std::uint8_t>(from[v] - prediction));
                return from[v];
            };
        };
        if (cells_of(values, &cells)) {
            walk_offsets<2>(at_left, in_front, coded(cells.data()));
        } else {
            walk_offsets<kBrickEdge>(at_left, in_front, coded(values.data()));
        }
    });
}

}  // namespace

void add_offsets(ChunkWriter& writer,
                 const BlockGrid& grid,
                 const BrickVolume<std::int8_t>& volume,
                 JobRunner& jobs) {
    std::vector<Kinds> layers(grid.bricks.z);
    jobs.run(layers.size(),
             [&](std::size_t k) { layers[k] = kinds_of_layer(volume, static_cast<int>(k)); });
    std::vector<std::uint8_t> kind, one;
    for (const Kinds& layer : layers) {
        append(kind, layer.kind);
        append(one, layer.one);
    }
    writer.add("ofs.kind", false, std::move(kind));
    writer.add("ofs.one", false, std::move(one));
    writer.add_packed(
        "ofs.val", false,
        pack_blocks(grid, jobs, [&](std::size_t block, std::vector<std::uint8_t>* out) {
            add_values(grid, block, volume, out);
        }));
}

Status read_offsets(const ChunkReader& reader,
                    JobRunner& jobs,
                    BlockParts* parts,
                    BrickVolume<std::int8_t>* out) {
    using Bytes = RawVector<std::uint8_t>;
    const std::size_t layer = layer_bricks(parts->grid.bricks),
                      layers = static_cast<std::size_t>(parts->grid.bricks.z);
    SONOCASE_TRY(const auto kind,
                 reader.read_array<std::uint8_t, Bytes>("ofs.kind", layer * layers, jobs));
    const LayerKinds kinds(kind, layer, jobs);
    std::vector<std::size_t> first_one(layers + 1);
    std::size_t known = 0;
    for (std::size_t k = 0; k < layers; ++k) {
        first_one[k + 1] = first_one[k] + kinds.count(k, kOneOffset);
        for (unsigned v = 0; v < kOffsetKinds; ++v) known += kinds.count(k, v);
    }
    if (known != kind.size())
        return reader.fault("a brick of 'ofs.kind' is of an unknown kind", "make it again");
    SONOCASE_TRY(const auto one,
                 reader.read_array<std::uint8_t, Bytes>("ofs.one", first_one[layers], jobs));
    SONOCASE_TRY(auto frames, BlockFrames::open(reader, "ofs.val", parts->grid.count(),
                                                parts->grid.block_bricks() * kBrickVoxels));
    parts->offsets = std::move(frames);

    ValueOrder order;
    for (std::size_t k = 0; k < layers; ++k) {
        if (kinds.begins_as_before(k, [](unsigned v) { return v; })) order.met(0);
        for (std::size_t n = first_one[k]; n < first_one[k + 1]; ++n) order.met(one[n]);
    }
    for (const std::uint8_t v : order.values()) out->uniform.push_back(static_cast<std::int8_t>(v));
    PoolOrder places(kind, parts->grid, jobs, [](unsigned v) { return v >= kMixedOffsets; });
    if (!can_allocate(places.total() * kBrickVoxels))
        return reader.fault("needs more memory than is available", "use larger voxels");
    out->table.resize(kind.size());
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
                const unsigned v = kind[b];
                if (v == kOneOffset) before = kUniformBrick | order.index()[one[next_one++]];
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
