// SPDX-License-Identifier: Apache-2.0

// The chunks `ofs.*` of docs/format.md, part 2: echo offsets, each coded as its difference from a
// prediction by its neighbours to the left, in front and below. For the .cpp files of formats/
// only.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/volume/brick_volume.h"

namespace sonocase::detail {

// Walks over the values of a brick, x fastest. Edge: values per edge, 4 for voxels, or 2 for cells
// of 2 x 2 x 2 equal voxels. left, front: the 64 values of the bricks there, or null at the border
// of the block. value(v, prediction) returns value number v, an std::int8_t.
template <int Edge, class Value>
void walk_offsets(const std::int8_t* left, const std::int8_t* front, Value value) {
    constexpr int kStep = kBrickEdge / Edge, kRow = Edge + 1;
    // A plane of the brick with the faces of its neighbours around it, and the plane below.
    int planes[2][kRow * kRow] = {};
    int v = 0;
    for (int k = 0; k < Edge; ++k) {
        int* plane = planes[k & 1];
        const int* below = planes[~k & 1];
        const int base = kStep * 16 * k;
        for (int n = 0; n < Edge; ++n) {
            plane[kRow * (n + 1)] = left ? left[base + kStep * kBrickEdge * n + kBrickEdge - 1] : 0;
            plane[n + 1] = front ? front[base + kStep * n + kBrickEdge * (kBrickEdge - 1)] : 0;
        }
        plane[0] = (plane[kRow] + plane[1]) / 2;
        for (int j = 1; j <= Edge; ++j) {
            for (int i = 1; i <= Edge; ++i, ++v) {
                const int at = i + kRow * j;
                const int a = plane[at - 1], b = plane[at - kRow], ab = plane[at - kRow - 1];
                // The median of a, b, and the plane through the three neighbours.
                const int flat = std::max(std::min(a, b), std::min(std::max(a, b), a + b - ab));
                const int prediction = k == 0 ? flat : (flat + below[at]) >> 1;
                // Values of one label are whole dB apart.
                plane[at] =
                    value(v, static_cast<std::uint8_t>(a + 4 * ((prediction - a + 2) >> 2)));
            }
        }
    }
}

void add_offsets(ChunkWriter& writer,
                 const BlockGrid& grid,
                 const BrickVolume<std::int8_t>& volume,
                 JobRunner& jobs);

// Fills the table of `out` and allocates its pool, which is unpacked later from `parts`.
Status read_offsets(const ChunkReader& reader,
                    JobRunner& jobs,
                    BlockParts* parts,
                    BrickVolume<std::int8_t>* out);

}  // namespace sonocase::detail
