// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/pack_offsets.h"

#include <array>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/bundle/codec/brick_kinds.h"
#include "formats/bundle/codec/offset_prediction.h"

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
    std::vector<Kinds> layers(static_cast<std::size_t>(grid.bricks.z));
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

}  // namespace sonocase::detail
